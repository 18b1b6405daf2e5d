"""What is learnt of a sensor from its own scans: when points were measured, the pattern of its beams, its ego body."""
