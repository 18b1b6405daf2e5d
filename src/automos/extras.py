"""Optional packages: what installs them where they are missing.

`automos` on the package index is another project, so the hint names what this copy was installed from: the checkout it
runs from, the folder or wheel that pip was given, and only then the distribution's name.
"""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

DISTRIBUTION = "automos-lidar"
"""What pip calls the package whose import name and command are `automos`."""


def pip_install(extra: str) -> str:
    """Return the command that installs the optional dependencies `extra` beside this copy of AutoMOS."""
    return f"pip install '{_origin()}[{extra}]'"


def _origin() -> str:
    checkout = Path(__file__).parents[2]
    if (checkout / "pyproject.toml").is_file():
        return _from_here(checkout)
    try:
        told = distribution(DISTRIBUTION).read_text("direct_url.json")
    except PackageNotFoundError:
        return DISTRIBUTION
    url = urlparse(json.loads(told)["url"]) if told else None
    if url is None or url.scheme != "file":
        return DISTRIBUTION
    place = Path(url2pathname(url.path))
    return _from_here(place) if place.exists() else DISTRIBUTION


def _from_here(place: Path) -> str:
    return "." if place == Path.cwd() else str(place)
