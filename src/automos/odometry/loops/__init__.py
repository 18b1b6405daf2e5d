"""Loop closure: correction of drift at revisited places (off by default)."""
