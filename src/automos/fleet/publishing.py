"""Results become results by a marker that is written last.

`complete.json` in a recording's folder names every file with its size and checksum, what it was made from and with
which settings. It is removed before anything else changes, and written when every file has arrived and has been
checked: whatever lies in a folder without it is not to be used, whoever was interrupted, and however.
"""

import base64
import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from automos.core.atomic import write_text
from automos.core.claims import MARK, RESULTS, claim, is_run_record, mark_of, remove
from automos.core.errors import InputError
from automos.core.reading import parse_json, read_bytes
from automos.core.workspace import COMPLETE, RESULT_FILES, RUN_FILE, Workspace, write_run
from automos.fleet.storage import Store, StoreError, is_url, of_each, shown

MARKER = COMPLETE
_NOT_RESULTS = {"stages", "ledger", MARKER, MARK}
_LABELS = ("predictions/*.label", "confidences/*.npy")
_REPLACED = (*_LABELS, *RESULT_FILES)


@dataclass(frozen=True)
class Marker:
    """What complete.json says.

    Attributes
    ----------
    source : str
        Changes with the recording.
    settings : str
        Changes with the settings and the version.
    fingerprint : str
        Of the labels, as run.json has it.
    counts : dict of str to int
        Scans, points, and moving points.
    warnings : list of str
        Sentences.
    files : dict of str to dict[str, Any]
        Path below the folder: bytes and SHA-256.
    """

    source: str
    settings: str
    fingerprint: str
    counts: dict[str, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    files: dict[str, dict[str, Any]] = field(default_factory=dict)


def read_marker(target: str) -> Marker | None:
    """Return the marker of the results at `target` (a path or URL), None if there are no complete ones.

    Labels that are gone, or of another size than it says, were damaged since, and make results incomplete; what
    a review changes does not.
    """
    text = Store(target).read(MARKER) if is_url(target) else _read_here(Path(target) / MARKER)
    try:
        marker = Marker(**parse_json(text or b""))
        labels = {path: int(file["bytes"]) for path, file in marker.files.items() if _is_like(path, _LABELS)}
    except (ValueError, TypeError, LookupError, AttributeError):  # absent, or damaged from outside
        return None
    return marker if labels.items() <= _sizes(target, labels).items() else None


def _read_here(path: Path) -> bytes | None:
    return read_bytes(path) if path.exists() else None


def _sizes(target: str, paths: Iterable[str]) -> dict[str, int]:
    """Return the bytes of those files that are at `target`, at least of all `paths` that are."""
    if is_url(target):
        return {entry.path: entry.size for entry in Store(target).entries()}
    return {path: (Path(target) / path).stat().st_size for path in paths if (Path(target) / path).is_file()}


def require_ours(target: str) -> None:
    """Claim `target`, a path or URL, for results.

    Raises
    ------
    InputError : it holds what this program did not write.
    """
    if not is_url(target):
        claim(Path(target), RESULTS)
        return
    store = Store(target)
    theirs = next((entry.path for entry in store.entries() if _is_like(entry.path, _REPLACED)), None)
    if theirs is not None and store.read(MARK) != mark_of(RESULTS).encode() and not _is_run(store.read(RUN_FILE)):
        raise InputError(f"{shown(target)} holds {theirs}, which automos did not write: choose another --out")


def _is_run(text: bytes | None) -> bool:
    try:
        return is_run_record(parse_json(text or b""))
    except ValueError:
        return False


def withdraw(target: str) -> None:
    """Declare what lies at `target` incomplete."""
    if is_url(target):
        Store(target).remove([MARKER])
    else:
        remove(Path(target) / MARKER)


def publish(folder: Path, target: str, marker: Marker, source: str) -> None:
    """Bring all results in `folder` to `target`, check that they arrived, and write the marker.

    Parameters
    ----------
    target : str
        A URL, or the path of `folder` itself: then the marker alone is written.
    source : str
        Where the recording lies; named in run.json, which else would name a copy of it.

    Raises
    ------
    StoreError
        A file did not arrive as it was sent, or the store did not answer.
    """
    if is_url(source):
        run = Workspace(folder).read_run()
        run["recording"]["source"] = shown(source)
        write_run(folder, run)
    paths = sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.relative_to(folder).parts[0] not in _NOT_RESULTS and not path.name.endswith(".part")
    )
    digests = dict(zip(paths, of_each(lambda path: _digest(folder / path), paths), strict=True))
    files = {path: {"bytes": sent["bytes"], "sha256": sent["sha256"]} for path, sent in digests.items()}
    text = json.dumps(asdict(marker) | {"files": files}, indent=1)
    if not is_url(target):
        write_text(folder / MARKER, text)
        return
    store = Store(target)
    store.remove([MARKER])
    store.write(MARK, mark_of(RESULTS).encode())  # first: by it what was left half way is known to be ours
    of_each(lambda path: store.put(str(folder / path), path), paths)
    there = store.details()
    for path, sent in digests.items():
        _check(store, path, there.get(path), sent)
    store.remove([path for path in there if path not in files and _is_like(path, _LABELS)])
    store.write(MARKER, text.encode())


def _is_like(path: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatch(path, pattern) for pattern in patterns)


def _digest(path: Path) -> dict[str, Any]:
    contents = path.read_bytes()
    sha256, md5 = hashlib.sha256(contents), hashlib.md5(contents, usedforsecurity=False)
    return {"bytes": len(contents), "sha256": sha256.hexdigest(), "md5": md5.hexdigest()}


def _check(store: Store, path: str, there: dict[str, Any] | None, sent: dict[str, Any]) -> None:
    """Raise unless a file in the store is what was sent: by the checksum the store gives, else by reading it again."""
    if there is None or int(there.get("size") or 0) != sent["bytes"]:
        got = "nothing" if there is None else f"{there.get('size')} bytes"
        raise StoreError(f"{shown(store.url)}/{path} was sent with {sent['bytes']} bytes, {got} arrived")
    if _md5_of(there) == sent["md5"]:
        return
    contents = store.read(path)  # the store keeps another kind of checksum (encrypted or sent in parts), or none
    if contents is None or hashlib.sha256(contents).hexdigest() != sent["sha256"]:
        raise StoreError(f"{shown(store.url)}/{path} did not arrive as it was sent")


def _md5_of(info: dict[str, Any]) -> str | None:
    """Return the MD5 of a file that S3, Google's or Azure's store reports, in hexadecimal; None without one."""
    given = info.get("md5Hash") or (info.get("content_settings") or {}).get("content_md5")
    if given is not None:
        return (base64.b64decode(given) if isinstance(given, str) else bytes(given)).hex()
    etag = info.get("ETag")
    return None if etag is None else str(etag).strip('"')
