"""What goes out: files that other tools read."""
