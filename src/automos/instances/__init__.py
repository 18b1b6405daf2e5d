"""III-C: class-agnostic segments of one scan, and the boxes around them."""
