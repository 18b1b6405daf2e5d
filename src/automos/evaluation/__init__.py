"""How good labels and trajectories are (paper IV)."""
