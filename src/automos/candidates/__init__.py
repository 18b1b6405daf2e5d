"""III-B: which points may be dynamic. One module per method; each takes frames and returns a score per point."""
