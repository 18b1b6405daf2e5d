"""KITTI odometry and SemanticKITTI: sequences/SS/{velodyne, labels, poses.txt, calib.txt, times.txt}.

Poses are the left camera's in KITTI's own files; calib.txt carries them over to the sensor, and without one they are
taken as the sensor's. Many other recordings are published in this layout, so nothing is assumed of the sensor.
"""

from pathlib import Path

from automos.readers.files import natural_key
from automos.readers.folder import FolderSequence
from automos.readers.formats import Format

_SCANS = "velodyne"


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, or those of a dataset root (in `sequences/` or directly) by name."""
    if (path / _SCANS).is_dir():
        return [path]
    root = path / "sequences" if (path / "sequences").is_dir() else path
    if not root.is_dir():
        return []
    return sorted(
        (p for p in root.iterdir() if not p.name.startswith(".") and (p / _SCANS).is_dir()),
        key=lambda p: natural_key(p.name),
    )


class KittiSequence(FolderSequence):
    """One sequence in KITTI's layout."""

    def __init__(self, source: Path, codec: str | None = None):
        """List the scans in `source / velodyne`; errors are those of a plain folder."""
        super().__init__(source, codec, _SCANS)

    def _pose_files(self) -> list[Path]:
        # KITTI itself keeps the poses of sequences/SS in poses/SS.txt of the root.
        source = self.source.resolve()
        return [*super()._pose_files(), source.parent.parent / "poses" / f"{source.name}.txt"]


FORMAT = Format(
    layout="KITTI's layout (odometry, SemanticKITTI): velodyne/, and where present poses.txt, calib.txt, times.txt",
    truth="labels/*.label",
    find=find,
    open=KittiSequence,
    has_codecs=True,
)
