"""The numbers that a user may want to change, with unit, range and, if it is from the paper, its section.

There is one module per stage and one group per idea. Lengths are in metres, angles in degrees (in radians where
published parameters are), times in seconds. Order of precedence: preset < settings file < command line.

Presets and files of settings are in `settings/loading.py`, which the method does not need.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from automos.settings.candidates import (
    CandidatesSettings,
    EgoBodySettings,
    FreeSpaceSettings,
    GroundSettings,
)
from automos.settings.instances import DetectSettings, HdbscanSettings, InstancesSettings, SegmentSettings
from automos.settings.network import ImageSettings, ModelSettings, NetworkSettings, TrainingSettings
from automos.settings.odometry import OdometrySettings
from automos.settings.recording import RecordingSettings
from automos.settings.results import LabelsSettings, LoopSettings, MapSettings, OutputSettings
from automos.settings.tracking import (
    AssociationSettings,
    CompletionSettings,
    FilterSettings,
    GateSettings,
    TrackingSettings,
    VerdictSettings,
)
from automos.settings.tree import Settings, given_settings

if TYPE_CHECKING:
    from automos.settings.loading import PRESETS, dump_yaml, keys_of, load_settings, read_overrides

_OF_LOADING = ("PRESETS", "dump_yaml", "keys_of", "load_settings", "read_overrides")


def __getattr__(name: str) -> Any:
    if name not in _OF_LOADING:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.loading"), name)
