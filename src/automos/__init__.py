"""AutoMOS: automatic moving/static labels for every point of a LiDAR recording.

    result = automos.label(automos.open_sequence("my_log/"))   # or a list of (N, 3) arrays
    is_moving = result.labels(0) == automos.Label.MOVING       # one per point of the first scan, in its order

`result.save("folder")` keeps everything as `automos label` writes it, and `automos.load("folder")` reads either.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from automos.core.working_folder import ignore_settings_here

__version__ = "0.6.0"

if TYPE_CHECKING:
    from automos.core.array_sequence import ArraySequence as ArraySequence
    from automos.core.errors import AutomosError as AutomosError
    from automos.core.errors import InputError as InputError
    from automos.core.labels import Label as Label
    from automos.core.scan import Scan as Scan
    from automos.core.scan import Sequence as Sequence
    from automos.core.workspace import Workspace as Workspace
    from automos.labeler import Labeler as Labeler
    from automos.labeler import LabelledScan as LabelledScan
    from automos.labeling import label as label
    from automos.readers import open_recordings as open_recordings
    from automos.readers import open_sequence as open_sequence
    from automos.result import Result as Result
    from automos.result import load as load
    from automos.settings import load_settings as load_settings
    from automos.views.report import write_report as write_report
    from automos.writers import export_run as export_run

_BEFORE = {"open_run": "load"}
"""Names of version 0.6."""
_HOME = {
    "label": "labeling",
    "load": "result",
    "Result": "result",
    "Labeler": "labeler",
    "LabelledScan": "labeler",
    "Label": "core.labels",
    "open_sequence": "readers",
    "open_recordings": "readers",
    "ArraySequence": "core.array_sequence",
    "Sequence": "core.scan",
    "Scan": "core.scan",
    "load_settings": "settings",
    "Workspace": "core.workspace",
    "export_run": "writers",
    "write_report": "views.report",
    "AutomosError": "core.errors",
    "InputError": "core.errors",
}
__all__ = [*_HOME, "__version__"]

ignore_settings_here()


def __getattr__(name: str) -> Any:
    # Imported on first use: `automos --help` should not wait for numba and SciPy.
    name = _BEFORE.get(name, name)
    if name not in _HOME:
        raise AttributeError(f"module 'automos' has no attribute '{name}'")
    return getattr(import_module(f"automos.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
