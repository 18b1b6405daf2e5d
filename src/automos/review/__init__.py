"""A person's word on tracks: shown, decided, kept in a log, and applied to every later run."""
