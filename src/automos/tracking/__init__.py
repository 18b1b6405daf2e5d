"""III-D: tracks, whether they move, and their points."""
