"""AutoMOS: automatic moving/static labels for every point of a LiDAR recording.

    result = automos.label(automos.open_sequence("my_log/"))   # or a list of (N, 3) arrays
    is_moving = result.labels(0) == automos.Label.MOVING       # one per point of the first scan, in its order

`automos.label` keeps its results in memory; with `workspace=automos.Workspace(folder)` it finds them there again.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from automos.working_folder import ignore_settings_here

__version__ = "0.6.0"

if TYPE_CHECKING:
    from automos.array_sequence import ArraySequence as ArraySequence
    from automos.datasets import open_recordings as open_recordings
    from automos.datasets import open_sequence as open_sequence
    from automos.errors import AutomosError as AutomosError
    from automos.errors import InputError as InputError
    from automos.export import export_run as export_run
    from automos.labeler import Labeler as Labeler
    from automos.labeler import LabelledScan as LabelledScan
    from automos.labels import Label as Label
    from automos.pipeline import label as label
    from automos.result import Result as Result
    from automos.results.open_run import open_run as open_run
    from automos.scan import Scan as Scan
    from automos.scan import Sequence as Sequence
    from automos.settings import load_settings as load_settings
    from automos.visualization.report import write_report as write_report
    from automos.workspace import Workspace as Workspace

_HOME = {
    "label": "pipeline",
    "Result": "result",
    "Labeler": "labeler",
    "LabelledScan": "labeler",
    "Label": "labels",
    "open_sequence": "datasets",
    "open_recordings": "datasets",
    "ArraySequence": "array_sequence",
    "Sequence": "scan",
    "Scan": "scan",
    "load_settings": "settings",
    "Workspace": "workspace",
    "open_run": "results.open_run",
    "export_run": "export",
    "write_report": "visualization.report",
    "AutomosError": "errors",
    "InputError": "errors",
}
__all__ = [*_HOME, "__version__"]

ignore_settings_here()


def __getattr__(name: str) -> Any:
    # Imported on first use: `automos --help` should not wait for numba and SciPy.
    if name not in _HOME:
        raise AttributeError(f"module 'automos' has no attribute '{name}'")
    return getattr(import_module(f"automos.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
