"""All settings of one run, a branch for each stage."""

from automos.core.arguments import require_kind
from automos.settings.candidates import CandidatesSettings
from automos.settings.group import Group
from automos.settings.instances import InstancesSettings
from automos.settings.network import NetworkSettings
from automos.settings.odometry import OdometrySettings
from automos.settings.recording import RecordingSettings
from automos.settings.results import LabelsSettings, MapSettings, OutputSettings
from automos.settings.tracking import TrackingSettings


class Settings(Group):
    """All settings of one run."""

    recording: RecordingSettings = RecordingSettings()
    odometry: OdometrySettings = OdometrySettings()
    candidates: CandidatesSettings = CandidatesSettings()
    instances: InstancesSettings = InstancesSettings()
    tracking: TrackingSettings = TrackingSettings()
    labels: LabelsSettings = LabelsSettings()
    output: OutputSettings = OutputSettings()
    network: NetworkSettings = NetworkSettings()
    map: MapSettings = MapSettings()

    def __repr__(self) -> str:
        return f"<Settings: {', '.join(type(self).model_fields)}; automos.settings.dump_yaml shows all values>"


def given_settings(settings: Settings | None) -> Settings:
    """Return the given settings, or the default preset for None; InputError if they are not settings."""
    if settings is None:
        return Settings()
    require_kind(settings, Settings, "settings", "what automos.load_settings returns")
    return settings
