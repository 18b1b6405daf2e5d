"""Places seen again, and the drift that they show (off by default)."""

from automos.loop_closure.closing import close_loops

__all__ = ["close_loops"]
