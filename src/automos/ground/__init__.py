"""The ground: its plane near the sensor, which gives the vertical, and its surface in each scan."""
