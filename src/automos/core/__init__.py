"""What every room builds on: scans, sequences, geometry, voxels, files, errors, workers."""
