"""The methods that only the preset `paper` runs, as published; baselines share some of them."""
