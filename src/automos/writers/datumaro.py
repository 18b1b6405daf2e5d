"""CVAT's export "Datumaro 3D 1.0": the parts that are read, checked before they are used."""

import zipfile
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AliasPath, BaseModel, Field, TypeAdapter

from automos.core.reading import MAX_TEXT, checked, damage_reported, parse_json, read_json, require_regular
from automos.writers.annotation_tools import ANNOTATIONS


class _Attributes(BaseModel):
    outside: bool = False
    track_id: int | None = None


class Cuboid(BaseModel):
    """A box in one scan; `label_id` is an index into the names of classes."""

    type: Literal["cuboid_3d"]
    label_id: Annotated[int, Field(ge=0)]
    attributes: _Attributes = _Attributes()
    position: list[float]
    scale: list[float]
    rotation: list[float]


class _Tag(BaseModel):
    """Of a scan as a whole: it says nothing of motion."""

    type: Literal["label"]


class _Item(BaseModel):
    id: str | int
    annotations: list[Annotated[Cuboid | _Tag, Field(discriminator="type")]]

    @property
    def cuboids(self) -> list[Cuboid]:
        """The boxes that are in sight."""
        return [box for box in self.annotations if isinstance(box, Cuboid) and not box.attributes.outside]


class _Label(BaseModel):
    name: str


class Datumaro(BaseModel):
    """The annotations of a task, an item a scan."""

    labels: Annotated[list[_Label], Field(validation_alias=AliasPath("categories", "label", "labels"))]
    items: list[_Item]


_DATUMARO = TypeAdapter(Datumaro)


def read_datumaro(path: Path) -> Datumaro | None:
    """Return the annotations of a zip, a folder or a JSON file; None where it holds nothing of the kind.

    Raises
    ------
    InputError
        It is damaged, or holds shapes that are not boxes.
    """
    with damage_reported(path, "is damaged", "export it from CVAT again"):
        if path.is_dir():
            document = read_json(path / ANNOTATIONS) if (path / ANNOTATIONS).exists() else None
        else:
            require_regular(path)
            document = _read_zip(path) if zipfile.is_zipfile(path) else read_json(path)
    if not isinstance(document, dict) or "items" not in document:
        return None
    with damage_reported(path, "is not an export of CVAT as 'Datumaro 3D'", "export it again"):
        return checked(_DATUMARO, document)


def _read_zip(path: Path) -> object:
    """Return what the archive's annotations hold, None without; ValueError where they unpack to more than any has."""
    with zipfile.ZipFile(path) as archive:
        if ANNOTATIONS not in archive.namelist():
            return None
        with archive.open(ANNOTATIONS) as file:
            text = file.read(MAX_TEXT + 1)  # whatever the archive says of their size
    if len(text) > MAX_TEXT:
        raise ValueError(f"its annotations unpack to more than {MAX_TEXT >> 20} MB")
    return parse_json(text)
