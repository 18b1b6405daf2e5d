"""A zip as SemanticKITTI's benchmark wants it: sequences/SS/predictions/NNNNNN.label.

Its validation asks for the directories as entries of their own, for files named by six digits, and for four bytes per
point. A recording whose name is not a sequence number is written as sequence 00.
"""

import zipfile
from collections import Counter
from pathlib import Path

from automos.core.atomic import atomic_path
from automos.core.claims import SIGN
from automos.core.errors import InputError
from automos.core.reading import DAMAGE
from automos.results.run_files import RunFiles
from automos.writers.formats import Export


def write(run: RunFiles, out: Path) -> None:
    """Write the zip `out`; a zip that is there already gets this sequence added, or in place of the one it has.

    Raises
    ------
    InputError
        Scans that are not named by numbers of up to six digits, or two by the same number.
    """
    files = _files_of(run)
    sequence = _number_of(run.sequence.name)
    folder = f"sequences/{sequence}/predictions/"
    with atomic_path(out) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = SIGN
        for directory in ("sequences/", f"sequences/{sequence}/", folder):
            archive.writestr(zipfile.ZipInfo(directory), b"")
        if out.exists():
            _copy_others(out, archive, f"sequences/{sequence}/")
        for index in run.each("writing zip"):
            packed = run.packed(index, len(run.scan(index))) & 0xFFFF
            entry = zipfile.ZipInfo(f"{folder}{files[index]}.label")
            archive.writestr(entry, packed.astype("<u4").tobytes(), zipfile.ZIP_DEFLATED)


def _files_of(run: RunFiles) -> list[str]:
    """Return the six digits by which the benchmark names each scan; InputError where it cannot."""
    stray = next((name for name in run.names if not name.isdecimal() or int(name) > 999_999), None)
    if stray is not None:
        raise InputError(
            f"{run.sequence.name} has a scan named {stray!r}; the benchmark names scans by six digits: rename the "
            "scans, or take the label files in the results folder"
        )
    files = [f"{int(name):06d}" for name in run.names]
    twice = next((file for file, times in Counter(files).items() if times > 1), None)
    if twice is not None:
        raise InputError(f"{run.sequence.name} has two scans numbered {twice}: rename one, and label again")
    return files


def _number_of(name: str) -> str:
    """Return the two digits of the sequence that a recording of this name is."""
    return f"{int(name):02d}" if name.isdecimal() else "00"


def _copy_others(old: Path, archive: zipfile.ZipFile, without: str) -> None:
    """Copy the other sequences of zip `old`, that a benchmark's sequences may be written one after the other."""
    try:
        with zipfile.ZipFile(old) as before:
            for entry in before.infolist():
                if entry.filename != "sequences/" and not entry.filename.startswith(without):
                    archive.writestr(entry, before.read(entry))
    except DAMAGE:
        raise InputError(f"{old} is not a zip file that can be read; remove it or choose another --out") from None


EXPORTS = {
    "semantickitti": Export(
        "zip for the benchmark: sequences/SS/predictions/*.label", write, suffix=".zip", name_of=_number_of
    ),
}
