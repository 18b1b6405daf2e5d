"""Loop closure: correction of drift at revisited places, for maps (off by default)."""
