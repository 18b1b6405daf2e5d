"""Loop closure: correction of drift at revisited places (off by default)."""

from automos.odometry.loops.closing import close_loops

__all__ = ["close_loops"]
