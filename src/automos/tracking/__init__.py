"""III-D: objects over time, whether they move, and the points that are theirs."""
