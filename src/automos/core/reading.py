"""Reads files from any source: regular files only, with a size limit, and damage reported in a sentence.

A pipe or a device would block without end. Whatever makes a parser fail (a malformed number, a missing column, endless
nesting, a count beyond all memory) is reported as a fault of the file.
"""

import errno
import json
import math
import os
import re
import stat
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tokenize import TokenError
from typing import Any, ClassVar, TypeVar
from urllib.parse import SplitResult, urlsplit

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import TypeAdapter, ValidationError

from automos.core.errors import AutomosError, InputError

T = TypeVar("T")
DAMAGE = (
    ValueError, TypeError, LookupError, AttributeError, ArithmeticError, AssertionError, EOFError, RuntimeError,
    MemoryError, NotImplementedError, SyntaxError, TokenError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What parsers raise, our own and others', when they are given what they were not made for."""

MAX_TEXT = 268_435_456
"""Bytes of text read at once; a drive of a day has times of a tenth of that."""
MAX_YAML = 32_768
"""Letters of YAML, which takes a second, as it is parsed in Python; all settings have 2 600."""


@contextmanager
def damage_reported(
    path: Path | str,
    what: str = "is damaged, or not what its name says",
    remedy: str = "copy it again",
    missing: str = "",
    kinds: type[Exception] | tuple[type[Exception], ...] = DAMAGE,
) -> Iterator[None]:
    """Raise InputError that names `path` for whatever goes wrong in the block, `what` that means and a `remedy`.

    Of what is not there, `missing` says what to do. `kinds` is what damage raises: others' libraries raise anything.
    """
    try:
        yield
    except AutomosError:
        raise
    except Exception as error:
        if missing and isinstance(error, FileNotFoundError):
            raise InputError(f"{path} is missing; {missing}") from None
        if isinstance(error, OSError) and error.errno is not None:  # others' libraries raise such without, of damage
            within = error.filename if str(error.filename).startswith(str(path)) else path
            raise InputError(f"{within} cannot be read: {error.strerror}") from error
        if not isinstance(error, (OSError, kinds)):
            raise
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path} {what} ({why}); {remedy}") from error


def require_regular(path: Path) -> None:
    """Raise where `path` is a pipe, a device or the like, one of the kernel's own files, or a link to one.

    Raises
    ------
    InputError
        It is; OSError where it is absent.
    """
    found = os.stat(path)
    if not stat.S_ISREG(found.st_mode) or found.st_dev in _kernels_own():
        kind = "folder" if stat.S_ISDIR(found.st_mode) else "pipe, a device or the like"
        raise InputError(f"{path} is a {kind}; only plain files are read")


@cache
def _kernels_own() -> frozenset[int]:
    """Return the devices of what looks like files and is none: some (/proc/kmsg) are waited for without end."""
    return frozenset(os.stat(place).st_dev for place in ("/proc", "/sys") if os.path.ismount(place))


def given_path(value: str | os.PathLike[str], what: str) -> Path:
    """Return `value` as a path; InputError if no file or folder can be named so, which `what` calls it."""
    try:
        path = Path(value)
        path.lstat()
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not a path ({error}): give a text or a pathlib.Path, not {value!r:.80}") from None
    except OSError as error:  # what is not there yet may be made
        if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise InputError(f"{what} {value!s:.80} cannot be used ({error.strerror}): give another path") from None
    return path


def is_there(path: Path) -> bool:
    """Return whether something has this name, be it a link to nothing: what is meant to be read is not passed over."""
    return os.path.lexists(path)


def read_bytes(path: Path, most: int | None = None) -> bytes:
    """Return what is in a regular file of at most `most` bytes.

    Raises
    ------
    InputError
        It is none; OSError where it is absent or cannot be read.
    """
    require_regular(path)
    if most is not None and os.path.getsize(path) > most:
        raise InputError(f"{path} has {os.path.getsize(path)} bytes, more than anything of its kind; check what it is")
    try:
        return Path(path).read_bytes()
    except MemoryError:
        raise InputError(f"{path} has {os.path.getsize(path)} bytes, more than there is memory for; check it") from None


def read_text(path: Path) -> str:
    """Return the text in a regular file, without the mark that editors of Windows begin it with.

    Errors are those of `read_bytes`, and UnicodeDecodeError.
    """
    return read_bytes(path, MAX_TEXT).decode("utf-8-sig")


def read_json(path: Path) -> Any:
    """Return what a JSON file holds; errors are those of `read_text`, and ValueError where it is none."""
    return parse_json(read_text(path))


def parse_json(text: str | bytes) -> Any:
    """Return what JSON `text` holds; ValueError where it is none, nested too deeply included."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


class _Loader(yaml.SafeLoader):
    """YAML 1.2 without aliases: what we read needs none, and a few of them stand for more than any memory holds.

    Nor is a name there twice, of which all but the last would be left out in silence. Of YAML 1.1, which PyYAML reads,
    010 was 8 and 1:30 was 90.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, list[tuple[str, re.Pattern[str]]]]] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has aliases; write values out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        twice = next((name for name, times in names.items() if times > 1), None)
        if twice is not None:
            raise yaml.YAMLError(f"{twice!r} is there twice")
        return super().construct_mapping(node, deep)


class YamlDumper(yaml.SafeDumper):
    """Writes what `parse_yaml` reads back: texts in quotes that would be something else in YAML 1.1 or 1.2."""


for _kind, _form in {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}.items():
    for _class in (_Loader, YamlDumper):
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", re.compile(f"({_form})$"), None)
_Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(loader.construct_scalar(node)))


def checked(kind: TypeAdapter[T], value: Any) -> T:
    """Return `value`, of JSON, as `kind`; ValueError that says where it is none."""
    try:
        return kind.validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = " > ".join(str(part) for part in first["loc"])[:80]
        raise ValueError(f"{where or 'it'}: {first['msg'].lower()}") from None


def parse_yaml(text: str) -> Any:
    """Return what YAML `text` holds; ValueError where it is none: aliases and nesting without end included."""
    if len(text) > MAX_YAML:
        raise ValueError(f"it has {len(text):,} letters, more than anything of its kind")
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(" ".join(str(error).split())) from None  # its messages draw the place on lines of their own


def parse_url(text: str) -> SplitResult:
    """Return the parts of an address; InputError where it is none, without what may be secret in it."""
    try:
        return urlsplit(text)
    except ValueError as error:
        raise InputError(f"{text.rpartition('@')[2]} is not an address ({error}): write scheme://host/path") from None


def read_array(path: Path) -> npt.NDArray[Any]:
    """Return the array in a NumPy file; ValueError where it is none or not whole, InputError if it is of no numbers."""
    require_regular(path)
    try:
        parsed_again(lambda: _require_whole(path))
        return parsed_again(lambda: np.load(path, allow_pickle=False))
    except (OSError, InputError):
        raise
    except Exception as error:  # damaged headers, which are Python, break their parser in many ways
        raise ValueError(" ".join(str(error).split())) from None


def parsed_again(read: Callable[[], T]) -> T:
    """Return what `read` gives; once more where Python stumbles over its own counting, not over the file.

    Headers of arrays are Python, and 3.11 at times ends with "AST constructor recursion depth mismatch" while several
    threads parse such.
    """
    for _ in range(20):
        try:
            return read()
        except SystemError:
            continue
    return read()


def _require_whole(path: Path) -> None:
    """Raise ValueError where the file is not an array, or does not hold what its header promises."""
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
        if dtype.hasobject:
            raise InputError(f"{path} holds objects of Python, which are not read; save its numbers with numpy.save")
        promised, got = math.prod(shape) * dtype.itemsize, path.stat().st_size - file.tell()
    if min(shape, default=1) < 0 or promised != got:
        raise ValueError(f"its header promises {promised} bytes of shape {shape}, but it holds {got}")
