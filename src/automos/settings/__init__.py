"""The numbers that a user may want to change, with unit, range and, if it is from the paper, its section.

There is one module per stage and one group per idea. Lengths are in metres, angles in degrees (in radians where
published parameters are), times in seconds. Order of precedence: preset < settings file < command line.
"""

from automos.settings.candidates import (
    CandidatesSettings,
    EgoBodySettings,
    FreeSpaceSettings,
    GroundSettings,
)
from automos.settings.instances import DetectSettings, HdbscanSettings, InstancesSettings, SegmentSettings
from automos.settings.loading import PRESETS, dump_yaml, given_settings, keys_of, load_settings, read_overrides
from automos.settings.network import ImageSettings, ModelSettings, NetworkSettings, TrainingSettings
from automos.settings.odometry import LoopSettings, OdometrySettings
from automos.settings.recording import RecordingSettings
from automos.settings.results import LabelsSettings, MapSettings, OutputSettings
from automos.settings.tracking import (
    AssociationSettings,
    CompletionSettings,
    FilterSettings,
    GateSettings,
    TrackingSettings,
    VerdictSettings,
)
from automos.settings.tree import Settings

__all__ = [
    "PRESETS",
    "AssociationSettings",
    "CandidatesSettings", "CompletionSettings", "DetectSettings",
    "EgoBodySettings", "FilterSettings", "FreeSpaceSettings", "GateSettings",
    "GroundSettings", "HdbscanSettings", "ImageSettings", "InstancesSettings",
    "LabelsSettings", "LoopSettings", "MapSettings", "ModelSettings", "NetworkSettings",
    "OdometrySettings", "OutputSettings", "RecordingSettings",
    "SegmentSettings", "Settings",
    "TrackingSettings", "TrainingSettings", "VerdictSettings",
    "dump_yaml", "given_settings", "keys_of", "load_settings", "read_overrides",
]  # fmt: skip
