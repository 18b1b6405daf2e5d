"""The results folder of a run: its contents, how it is written, and how it is read again with its recording."""
