"""Maps of a recording without what moves (paper Fig. 5), and how good they are."""
