"""Small cells and paths made in place; the collision scene is left out unless a test wants it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from postproc.cell.cell import Cell, Tool, Workpiece
from postproc.cell.robotfile import load_robot
from postproc.cell.schema import KrlOptions, Limits, Motion, Optimize, Process, Read
from postproc.geometry.frames import transform
from postproc.model.toolpath import Arcs, MotionKind, ToolPath
from postproc.units import DEG

PAPER_STIFFNESS = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
"""N*m/rad, Jiao et al. 2022, no grid."""


@pytest.fixture
def robot():
    return replace(load_robot("kuka_kr500_r2830"), joint_stiffness=PAPER_STIFFNESS)


@pytest.fixture
def make_cell(robot):
    """Return a function that makes a cell; ``h``, ``s``: TCP below and ahead of the flange [m].

    ``options``, ``motion``: keys of ``[optimize]`` and ``[motion]``; ``optimize``: fields in SI.
    """

    def make(h=0.362, s=0.107, optimize=None, motion=None, options=None, **changes):
        tool = Tool(1, "spindle", transform(np.eye(3), [s, 0.0, h]), np.array([1.0, 0.0, 0.0]))
        wishes = TypeAdapter(Read[Optimize]).validate_python(options or {})
        parts = {
            "name": "test",
            "path": "cell.toml",
            "robot": robot,
            "tools": (tool,),
            "bases": (Workpiece(1, np.eye(4)),),
            "obstacles": (),
            "limits": Limits(2.0 * DEG, 5.0 * DEG, 0.0, np.inf),
            "optimize": replace(wishes, **(optimize or {})),
            "process": Process((0.0, 0.0, -100.0)),
            "motion": TypeAdapter(Read[Motion]).validate_python(
                {"feed_mm_min": 600.0} | (motion or {})
            ),
            "krl": TypeAdapter(Read[KrlOptions]).validate_python({}),
        }
        return Cell(**(parts | changes))

    return make


@pytest.fixture
def make_path():
    """Return a function that makes a toolpath from points [m], axes, kinds, and columns."""

    def make(points, axes, kind=MotionKind.LINEAR, **changes):
        points = np.asarray(points, dtype=float)
        n = len(points)
        axes = np.broadcast_to(np.asarray(axes, dtype=float), (n, 3))
        nothing = np.full(n, -1)
        columns = {
            "path": "part.cls",
            "name": "part",
            "format": "apt",
            "dialect": "nx",
            "units": "mm",
            "points": points,
            "axes": axes / np.linalg.norm(axes, axis=1, keepdims=True),
            "kind": np.broadcast_to(kind, (n,)),
            "feed": np.full(n, np.nan),
            "line": np.arange(n) + 10,
            "operation": np.zeros(n),
            "tool": nothing,
            "arc": nothing,
            "cycle": nothing,
            "arcs": Arcs.none(),
        }
        return ToolPath(**(columns | changes))

    return make


@pytest.fixture
def no_scene(monkeypatch):
    """Plan without collision checks."""
    monkeypatch.setattr("postproc.planning.job._scene", lambda problem: None)
