"""Loop closure: correction of drift at revisited places (off by default)."""

from automos.loop_closure.closing import close_loops

__all__ = ["close_loops"]
