"""AutoMOS: automatic moving/static labels for every point of a LiDAR recording."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from automos.working_folder import ignore_settings_here

__version__ = "0.1.0"

if TYPE_CHECKING:
    from automos.datasets import open_sequence as open_sequence
    from automos.errors import AutomosError as AutomosError
    from automos.labels import Label as Label
    from automos.pipeline import Result as Result
    from automos.pipeline import label as label
    from automos.scan import ArraySequence as ArraySequence
    from automos.scan import Scan as Scan
    from automos.scan import Sequence as Sequence
    from automos.settings import load_settings as load_settings
    from automos.workspace import Workspace as Workspace

_HOME = {
    "open_sequence": "datasets",
    "AutomosError": "errors",
    "Label": "labels",
    "Result": "pipeline",
    "label": "pipeline",
    "ArraySequence": "scan",
    "Scan": "scan",
    "Sequence": "scan",
    "load_settings": "settings",
    "Workspace": "workspace",
}
__all__ = [*_HOME, "__version__"]

ignore_settings_here()


def __getattr__(name: str) -> Any:
    # Imported on first use: `automos --help` should not wait for numba and SciPy.
    if name not in _HOME:
        raise AttributeError(f"module 'automos' has no attribute '{name}'")
    return getattr(import_module(f"automos.{_HOME[name]}"), name)
