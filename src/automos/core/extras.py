"""Optional packages: imported where they are needed, and the command that installs a missing one.

The package called `automos` on PyPI is a different project, so the hint names the source of this installation: the
checkout it runs from, the folder or wheel that was given to pip, and only then the name of the distribution.
"""

import importlib
import json
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any
from urllib.parse import urlparse
from urllib.request import url2pathname

from automos.core.errors import MissingExtraError

DISTRIBUTION = "automos-lidar"
"""What pip calls the package whose import name and command are `automos`."""


def pip_install(extra: str) -> str:
    """Return the command that installs the optional dependencies `extra` beside this copy of AutoMOS."""
    return f"pip install '{_origin()}[{extra}]'"


def import_extra(module: str, extra: str, sentence: str = "{} is not installed; run: {}") -> Any:
    """Return the imported `module`, which comes with the optional dependencies `extra`.

    sentence : what is told without it, of the package and the command that installs it.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(sentence.format(module.partition(".")[0], pip_install(extra))) from None


def _origin() -> str:
    checkout = Path(__file__).parents[3]
    if (checkout / "pyproject.toml").is_file():
        return _from_here(checkout)
    try:
        url_file = distribution(DISTRIBUTION).read_text("direct_url.json")
    except PackageNotFoundError:
        return DISTRIBUTION
    url = urlparse(json.loads(url_file)["url"]) if url_file else None
    if url is None or url.scheme != "file":
        return DISTRIBUTION
    place = Path(url2pathname(url.path))
    return _from_here(place) if place.exists() else DISTRIBUTION


def _from_here(place: Path) -> str:
    return "." if place == Path.cwd() else str(place)
