"""Review of tracks by a person: shown, decided, logged, and applied to every later run."""
