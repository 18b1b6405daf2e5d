"""How a LiDAR sees: beams, what they hit, what comes back."""
