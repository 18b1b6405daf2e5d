"""Jobs of `all.py` about what stands beside the labels: networks, maps, the review, the simulator, what things cost."""

from __future__ import annotations

from job import Job

ODOMETRY_ROOMS = ("odometry/", "sensor/", "ground/level", "trajectory", "settings/odometry", "voxels")
ONLINE_NETWORK_ROOMS = (
    *("learning/online", "learning/segment", "learning/recordings", "network/", "settings/network", "online/"),
    *ODOMETRY_ROOMS,
)
TRAINING_ROOMS = ("network/",)
"""What networks are trained with; what they learn from are labels, so all that shapes these counts as well."""
EVERYTHING = ("",)

_NETWORKS = ("--out", "CACHE/networks")
_SMALL = ("--worlds", "1", "--scans", "12", "--epochs", "2", "--samples", "8")
_SMALL_NETWORKS = ("--out", "CACHE/networks-quick", *_SMALL)

JOBS_BESIDE_LABELS = (
    Job(
        "table-2",
        "networks.py",
        ("table-2", *_NETWORKS),
        ("table-2", *_SMALL_NETWORKS),
        also=TRAINING_ROOMS,
    ),
    Job(
        "table-3",
        "networks.py",
        ("table-3", *_NETWORKS, "--picture", "DOCS/images/finetuning.png"),
        ("table-3", *_SMALL_NETWORKS),
        also=TRAINING_ROOMS,
    ),
    Job(
        "self-training",
        "self_training.py",
        ("--networks", "CACHE/networks", "--out", "CACHE/self-training"),
        ("--networks", "CACHE/networks-quick", "--out", "CACHE/self-training-quick", *_SMALL),
        also=TRAINING_ROOMS,
    ),
    Job("shipped-network", "shipped_network.py", ("DRIVE_0005",), ("DRIVE_0005",), ONLINE_NETWORK_ROOMS),
    Job(
        "segment-speed",
        "segment_speed.py",
        ("DRIVE_0005",),
        ("DRIVE_0005", "--scans", "20"),
        ONLINE_NETWORK_ROOMS,
        is_timed=True,
    ),
    Job(
        "simulator-statistics",
        "simulator_statistics.py",
        ("--seeds", "0", "1", "2", "3"),
        ("--seeds", "0", "--scans", "4"),
        ("simulation/",),
        needs_recordings=True,
    ),
    Job(
        "simulator-speed",
        "simulator_speed.py",
        (),
        ("--scenarios", "city", "--sweeps", "5"),
        ("simulation/",),
        is_timed=True,
    ),
    Job("first-minute", "first_minute.py", ("DRIVE_0005",), ("DRIVE_0005", "--scans", "8"), EVERYTHING, is_timed=True),
    Job(
        "reference-poses",
        "reference_poses.py",
        ("--store", "STORE"),
        ("--store", "STORE", "--cases", "kitti_0027, 2 s"),
        ODOMETRY_ROOMS,
        needs_recordings=True,
    ),
    Job(
        "maps",
        "maps.py",
        ("DRIVE_0005", "--cache", "CACHE/maps"),
        ("DRIVE_0005", "--cache", "CACHE/maps", "--methods", "erasor", "default"),
    ),
    Job(
        "rivals-in-parts",
        "rivals_in_parts.py",
        ("--store", "STORE", "--out", "CACHE/labels"),
        ("--store", "STORE", "--out", "CACHE/labels", "--cases", "kitti_0005, first 30 scans"),
        needs_recordings=True,
    ),
    Job(
        "sampling",
        "sampling.py",
        ("--store", "STORE", "--scenarios", "city", "junction"),
        ("--store", "STORE", "--scenarios", "city", "--samples", "10"),
        also=("review/",),
    ),
    Job(
        "review-queue",
        "review_queue.py",
        ("--out", "CACHE/review", "--recordings", "kitti_0005", "kitti_0027"),
        ("--out", "CACHE/review", "--recordings", "kitti_0027"),
        also=("review/", "results/"),
        needs_recordings=True,
    ),
    Job(
        "review",
        "review.py",
        ("CACHE/review/kitti_0005", "--label", "DRIVE_0005"),
        ("CACHE/review/kitti_0005", "--label", "DRIVE_0005", "--objects", "1000", "--decisions", "10"),
        also=("review/", "results/"),
        is_timed=True,
    ),
    Job(
        "scale",
        "scale.py",
        ("--cache", "CACHE/scale"),
        ("--cache", "CACHE/scale", "--recordings", "4", "--scans", "12", "--skip-ray"),
        also=("fleet/",),
        is_timed=True,
    ),
    Job(
        "libraries",
        "libraries.py",
        (),
        ("--only", "files", "images"),
        also=("writers/", "readers/", "evaluation/", "fleet/"),
        is_timed=True,
    ),
)
