"""Evidence of motion: was the place of a point observed free, before or after? (paper III-B)"""
