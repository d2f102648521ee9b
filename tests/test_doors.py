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
    "postproc.trace.effects",
    "postproc.trace.formats",
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


SLOW = {
    # packages that take a tenth of a second and more to load, or are optional
    *("scipy", "pinocchio", "coal", "trimesh", "ruckig", "xacro", "xacrodoc", "jinja2", "PIL"),
    *("numpy", "distributed"),
    # rooms that load them, for those who need them in some calls only
    *("postproc.collision", "postproc.compensation", "postproc.comparison", "postproc.report"),
    *("postproc.gap", "postproc.jobs", "postproc.planning", "postproc.kinematics"),
    *("postproc.process", "postproc.krl", "postproc.cell", "postproc.model"),
    # a whole format, for a reader that is asked whether a file is its own
    *("postproc.readers.apt.file", "postproc.readers.gcode.file", "postproc.readers.delmia.file"),
}
"""What a function may load by itself, so that a command starts fast that does not need it."""
NOT_EVERYWHERE = {"postproc.version", "resource"}
"""The version while the package loads; what Windows does not have."""


def test_imports_in_functions_are_for_the_start_up():
    wrong = [
        f"{name}:{node.lineno}: {target}"
        for name, path in modules()
        if not inside(name, "postproc.cli")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        for target in targets(node)
        if not any(inside(target, allowed) for allowed in SLOW | NOT_EVERYWHERE)
    ]
    assert wrong == []


def targets(node):
    if isinstance(node, ast.ImportFrom):
        return [node.module or ""]
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
