"""Data sets for the trainers of moving-object segmentation, made of the results of many runs."""
