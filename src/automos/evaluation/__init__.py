"""Scores of labels and trajectories (paper IV)."""
