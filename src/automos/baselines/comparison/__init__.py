"""Comparison of methods on one recording: Table I and Fig. 4 of the paper."""
