"""Small readers that keep to what trainers do with a data set: pairing, numbers of labels, frames of poses."""

import numpy as np
import yaml


def lidar_poses(path, Tr):
    """Return poses as SemanticKITTI's trainers make them: of the LiDAR, relative to the first."""
    rows = np.loadtxt(path, delimiter=" ").reshape(-1, 3, 4)
    T = np.concatenate([rows, np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1, 1))], axis=1)
    return np.stack([np.linalg.inv(Tr) @ np.linalg.inv(T[0]) @ pose @ Tr for pose in T])


def calibration(path):
    """Return Tr of a calib.txt in which everything behind a key is a number."""
    found = {}
    for line in path.read_text().splitlines():
        key, *values = line.split(" ")
        found[key.rstrip(":")] = np.array([float(value) for value in values])
    return np.vstack([found["Tr"].reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])


class RangeImageTrainer:
    """LiDAR-MOS, MotionSeg3D and MF-MOS: sequences by number, scans and labels by sorted name, classes from yaml."""

    def __init__(self, root, split, classes="semantic-kitti-mos.yaml", sensor="sensor.yaml"):
        self.classes = yaml.safe_load((root / classes).read_text())
        self.arch = yaml.safe_load((root / sensor).read_text())["dataset"]
        self.scans, self.labels, self.poses = [], [], []
        for number in self.classes["split"][split]:
            folder = root / "sequences" / f"{int(number):02d}"
            scans = sorted((folder / "velodyne").rglob("*.bin"))
            labels = sorted((folder / "labels").rglob("*.label"))
            assert len(scans) == len(labels)
            self.scans += scans
            self.labels += labels
            self.poses.append(lidar_poses(folder / "poses.txt", calibration(folder / "calib.txt")))

    def __getitem__(self, index):
        """Return points (N, 4), classes (N,) and an image of them, as their `SemLaserScan` does."""
        points = np.fromfile(self.scans[index], np.float32).reshape(-1, 4)
        raw = np.fromfile(self.labels[index], np.int32)
        assert len(raw) == len(points) <= self.arch["max_points"]
        learning_map = self.classes["learning_map"]
        table = np.zeros(max(learning_map) + 100, np.int32)
        for number, kind in learning_map.items():
            table[number] = kind
        depth = np.linalg.norm(points[:, :3], axis=1)
        assert (depth > 0).all()
        sensor = self.arch["sensor"]
        up, down = np.radians(sensor["fov_up"]), np.radians(sensor["fov_down"])
        pitch = np.arcsin(points[:, 2] / depth)
        rows = np.floor((1.0 - (pitch + abs(down)) / (abs(down) + abs(up))) * sensor["img_prop"]["height"])
        assert np.isfinite(rows).all()
        means, spreads = np.array(sensor["img_means"]), np.array(sensor["img_stds"])
        image = (np.column_stack([depth, points]) - means) / spreads
        assert np.isfinite(image).all()
        return points, table[raw & 0xFFFF], rows


class HelimosTrainer:
    """4DMOS and MapMOS: SENSOR/split.txt; a file's number is its scan's place; ids above 250 move, 0 and 1 are none."""

    def __init__(self, root, sequence):
        sensor, split = sequence.split("/")
        self.scans = sorted((root / sensor / "velodyne").glob("*.bin"))
        listed = np.loadtxt(root / split, dtype=int).tolist()
        labels = sorted((root / sensor / "labels").glob("*.label"))
        self.labels = {int(path.stem): path for path in labels if int(path.stem) in listed}
        self.calibration = calibration(root / sensor / "calib.txt")

    def __getitem__(self, index):
        """Return points (N, 3) and labels (N,): 1 moving, 0 static, -1 none."""
        points = np.fromfile(self.scans[index], np.float32).reshape(-1, 4)[:, :3]
        raw = np.fromfile(self.labels[index], np.int32) & 0xFFFF
        labels = np.zeros_like(raw)
        labels[raw <= 1], labels[raw > 250] = -1, 1
        return points, labels
