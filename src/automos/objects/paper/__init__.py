"""Instances, verdict and labels of the preset `paper`."""
