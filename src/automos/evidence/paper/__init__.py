"""ERASOR, the evidence of the preset `paper`."""
