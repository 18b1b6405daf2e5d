"""How many settings there are, and that code reads every one of them."""

import ast
from pathlib import Path

import pytest
from pydantic import BaseModel

import automos
from automos.settings import Settings

MOST = 120
"""What one who changes settings can keep in mind; a constant beside its code is better than one more."""

SOURCE = Path(automos.__file__).parent


def leaves(group: type[BaseModel] = Settings, prefix: str = "") -> dict[str, tuple[str, str]]:
    """Return the class and the name of every setting, by its dotted key."""
    found = {}
    for name, field in group.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found |= leaves(field.annotation, f"{prefix}{name}.")
        else:
            found[prefix + name] = (group.__name__, name)
    return found


def groups(group: type[BaseModel] = Settings) -> dict[str, type[BaseModel]]:
    """Return every group of settings by the name of its class."""
    found = {group.__name__: group}
    for field in group.model_fields.values():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found |= groups(field.annotation)
    return found


class Readers(ast.NodeVisitor):
    """Finds which fields of which groups are read, by following annotations, assignments and attributes."""

    def __init__(self, words: set[str]) -> None:
        """Take the strings of the file: which of them `getattr` is given cannot be told."""
        self.groups, self.read, self.words = groups(), set(), words
        self.names: list[dict[str, str]] = [{}]
        self.attributes: dict[str, str] = {}  # of self, anywhere in the file

    def visit_Module(self, node: ast.Module) -> None:
        for _ in range(2):  # what __init__ keeps may be read in a method above it
            self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for field in node.body:  # of a data class
            if isinstance(field, ast.AnnAssign) and (kind := self._named(field.annotation)):
                self.attributes[field.target.id] = kind
        self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        everything = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        self.names.append({a.arg: kind for a in everything if (kind := self._named(a.annotation))})
        self.generic_visit(node)
        self.names.pop()

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if kind := self._named(node.annotation):
            self._bind(node.target, kind)
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=False))
            for name, value in pairs:
                if kind := self._kind(value):
                    self._bind(name, kind)
        self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        kind = self._kind(node.value)
        if kind and node.attr in self.groups[kind].model_fields:
            self.read.add((kind, node.attr))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if ast.unparse(node.func) == "getattr" and (kind := self._kind(node.args[0])):
            self.read |= {(kind, word) for word in self.words if word in self.groups[kind].model_fields}
        self.generic_visit(node)

    def _bind(self, target: ast.expr, kind: str) -> None:
        if isinstance(target, ast.Name):
            self.names[-1][target.id] = kind
        elif isinstance(target, ast.Attribute):
            self.attributes[target.attr] = kind

    def _named(self, annotation: ast.expr | None) -> str | None:
        text = "" if annotation is None else ast.unparse(annotation)
        return next((name for name in self.groups if name in text.replace("|", " ").split()), None)

    def _kind(self, node: ast.expr) -> str | None:
        """Return the group that an expression is, None where it is none, or nobody knows."""
        if isinstance(node, ast.Name):
            return next((names[node.id] for names in reversed(self.names) if node.id in names), None)
        if isinstance(node, ast.BoolOp):
            return next((kind for value in node.values if (kind := self._kind(value))), None)
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func).rsplit(".", 1)[-1]
            return (
                "Settings"
                if name in ("load_settings", "_settings", "settings")
                else name
                if name in self.groups
                else None
            )
        if not isinstance(node, ast.Attribute):
            return None
        kind = self._kind(node.value)
        if kind is None:  # self.settings.odometry, run.settings.odometry
            return self.attributes.get(node.attr) or ("Settings" if node.attr == "settings" else None)
        field = self.groups[kind].model_fields.get(node.attr)
        inner = field.annotation if field is not None else None
        return inner.__name__ if isinstance(inner, type) and issubclass(inner, BaseModel) else None


def read_in(text: str) -> set[tuple[str, str]]:
    """Return (class, field) of every setting that a module's text reads."""
    tree = ast.parse(text)
    readers = Readers(
        {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    )
    readers.visit(tree)
    return readers.read


@pytest.fixture(scope="module")
def read() -> set[tuple[str, str]]:
    return set().union(*(read_in(path.read_text()) for path in SOURCE.rglob("*.py") if path.parent.name != "settings"))


def test_every_setting_is_read_by_code(read):
    assert sorted(key for key, where in leaves().items() if where not in read) == []


def test_a_setting_that_nobody_reads_is_found():
    text = "def f(settings: Settings):\n    about = settings.map\n    return about.voxel"
    assert ("MapSettings", "voxel") in read_in(text)
    assert ("MapSettings", "max_range") not in read_in(text)
    assert ("MapSettings", "voxel") not in read_in("def f(settings: Frame):\n    return settings.voxel")


def test_there_are_no_more_settings_than_there_were():
    assert len(leaves()) <= MOST
