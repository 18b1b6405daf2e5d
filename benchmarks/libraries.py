"""Code of ours beside a library for the same job: speed, faults, size, licence. docs/architecture.md has the decisions.

    python benchmarks/libraries.py [--only files images pool trajectory clusters registration packages] [--json FILE]

Libraries that are not installed are left out; all of them: `pip install plyfile pypcd4 pillow pebble evo scikit-learn
kiss-icp psutil`. Times are the best of five, on one thread.
"""

from __future__ import annotations

import argparse
import importlib.metadata as metadata
import json
import re
from pathlib import Path

from library_files import files, images
from library_jobs import clusters, pool, registration, trajectory


def packages() -> dict[str, dict]:
    """Return version, licence and megabytes of each library, and of all it needs beyond what AutoMOS needs."""
    base = _needs("automos-lidar", set())
    out = {}
    for name in ("numpy", "pillow", "plyfile", "pypcd4", "pebble", "evo", "hdbscan", "scikit-learn", "kiss-icp"):
        try:
            about = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            continue
        licence = about.get("License-Expression") or (about.get("License") or "").split("\n")[0][:40]
        more = _needs(name, set()) - base
        sizes = {"own MB": _megabytes(name), "MB beside ours": round(sum(map(_megabytes, more)), 1)}
        out[name] = {"version": about["Version"], "licence": licence or "see its classifiers"} | sizes
    return out


def _needs(name: str, seen: set[str]) -> set[str]:
    """Return the installed packages that `name` needs, itself among them."""
    name = re.sub(r"[-_.]+", "-", name).lower()
    if name not in seen:
        try:
            needs = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            return seen
        seen.add(name)
        for need in needs:
            if "extra ==" not in need:
                _needs(re.match(r"[\w.-]+", need)[0], seen)
    return seen


def _megabytes(name: str) -> float:
    sizes = (file.locate().stat().st_size for file in metadata.files(name) or () if file.locate().is_file())
    return round(sum(sizes) / 1e6, 1)


PARTS = (files, images, pool, trajectory, clusters, registration, packages)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=[part.__name__ for part in PARTS])
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found = {}
    for part in PARTS:
        if args.only is None or part.__name__ in args.only:
            found[part.__name__] = part()
            print(part.__name__, *(f"  {name}: {row}" for name, row in found[part.__name__].items()), sep="\n")
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
