"""What only the preset `paper` runs, stage by stage, as published; baselines share some of it."""
