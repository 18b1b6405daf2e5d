"""Online labelling: the stages of `label`, scan by scan, with a window of the past."""
