"""Maps of a recording without moving objects (paper Fig. 5), and their metrics."""
