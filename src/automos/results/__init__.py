"""The results folder of a run: what is in it, how it is written, and how it is read again with its recording."""
