"""Every room has a door: who stands outside imports from the package, not from a file in it."""

import ast
from pathlib import Path

import pytest

from tests.places import ROOT

ROOMS = {
    ".".join(path.parent.relative_to(ROOT).parts)
    for path in (ROOT / "postproc").rglob("__init__.py")
}
SHELVES = {
    "postproc",
    "postproc.cli",
    "postproc.cli.commands",
    "postproc.gap.effects",
    "postproc.jobs",
    "postproc.krl.rules",
    "postproc.planning.states.objectives",
    "postproc.report",
    "postproc.report.pages",
}
"""Rooms of independent files: each file is a door of its own, so that a command loads only what it
needs and a registry finds its parts."""
OWN_DOORS = {"postproc.report.parts", "postproc.stiffness.identify", "postproc.stiffness.sample"}
"""Rooms in rooms that others enter directly: what is behind the outer door loads much less."""


def modules():
    for path in sorted((ROOT / "postproc").rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        yield name.removesuffix(".__init__"), path


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("postproc."):
            yield node.lineno, node.module


def inside(module, room):
    return module == room or module.startswith(f"{room}.")


def door_of(target, importer):
    """The package that ``importer`` has to name to get at something defined in ``target``."""
    parts = target.split(".")
    around = [".".join(parts[:i]) for i in range(1, len(parts) + 1)]
    around = [room for room in around if room in ROOMS and not inside(importer, room)]
    own = [room for room in around if room in OWN_DOORS]
    shut = [room for room in around if room not in SHELVES]
    return (own or shut or [target])[0]


def test_imports_go_through_the_doors():
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {target}, expected {door_of(target, name)}"
        for name, path in modules()
        for line, target in imported(path)
        if door_of(target, name) != target
    ]
    assert wrong == []


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_a_room_says_what_it_is_for(room):
    text = (ROOT / Path(*room.split(".")) / "__init__.py").read_text(encoding="utf-8")
    doc = ast.get_docstring(ast.parse(text))
    assert doc
    assert doc.split("\n")[0].endswith(".")
