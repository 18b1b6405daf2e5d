"""TIER IV's T4 data set: nuScenes' tables in annotation/, boxes marked as made automatically, with their scores."""

from functools import partial

from automos.writers.formats import Export
from automos.writers.nuscenes_tables import Layout, write

EXPORT = Export(
    writes="TIER IV T4 data set: annotation/*.json, data/LIDAR_CONCAT, lidarseg",
    write=partial(write, layout=Layout("annotation", "data/LIDAR_CONCAT", "LIDAR_CONCAT", "data_captured")),
)
