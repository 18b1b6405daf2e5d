"""The method at the pace of the sensor: the stages of `label`, fed scan by scan, with a window of the past."""
