"""A cell with the arm of the paper, and readings of a robot that the product does not know.

The readings come from ``tools/dev/hidden_twin``: other kinematics, full load equilibrium.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.geometry.frames import inverse, rotation_y, transform
from postproc.kinematics import build
from postproc.measurement.rows import MeasurementSet
from tests.cells import STIFFNESS, twin_text
from tools.dev.hidden_twin import Twin

K_PAPER = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
LOW, HIGH = np.array([1.5, -0.6, 0.5]), np.array([2.1, 0.6, 1.1])
TCP = np.array([0.107, 0.0, 0.362])
WEIGHT = np.array([0.0, 0.0, -50.0 * 9.80665])


@pytest.fixture(scope="session")
def cell_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(twin_text(STIFFNESS, origin=(1500, 0, 500)))
    return path


@pytest.fixture(scope="session")
def cell(cell_path):
    return load_cell(cell_path)


@pytest.fixture(scope="session")
def arm(cell):
    return build(cell.robot)


@pytest.fixture(scope="session")
def postures(arm, cell):
    """Return a function count, seed -> joints (count, 6) in the box, tool turned by -10..10 deg."""

    def made(count: int, seed: int = 0, spread: float = 10.0) -> np.ndarray:
        rng = np.random.default_rng(seed)
        where = LOW + rng.uniform(size=(count, 3)) * (HIGH - LOW)
        angle = np.radians(rng.uniform(-spread, spread, size=count))
        return reach(arm, cell, where, angle)

    return made


def reach(arm, cell, where, angle):
    """Return joints (n, 6) for tool points (n, 3) with the tool turned about its y axis."""
    T = transform(rotation_y(np.asarray(angle)), np.asarray(where))
    start = np.radians([0.0, -60.0, 90.0, 0.0, 60.0, 180.0])
    q, valid = arm.ik(T @ inverse(cell.tool.T_flange_tcp))
    slot = int(arm.slot(start))
    assert np.all(valid[:, slot])
    return arm.nearest(q[:, slot], start)


def wrench_of(twin: Twin, q: np.ndarray, force: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the wrench at the tool point of a force at another point of the flange."""
    R = twin.chain(q)[2][:, :3, :3]
    moment = np.cross(R @ (at - twin.tcp), np.broadcast_to(force, (len(q), 3)))
    return np.hstack([np.broadcast_to(force, (len(q), 3)), moment])


def campaign(twin: Twin, q: np.ndarray, forces, sigma: float, seed: int = 0) -> MeasurementSet:
    """Return readings of postures (n, 6): unloaded, then each (force, point in the flange)."""
    rng = np.random.default_rng(seed)
    angles, points, wrenches = [q], [twin.point(q)], [np.zeros((len(q), 6))]
    for force, at in forces:
        angles.append(q)
        points.append(twin.loaded_point(q, force, at))
        wrenches.append(wrench_of(twin, q, force, at))
    position = np.vstack(points)
    n = len(position)
    return MeasurementSet(
        path="measured.csv",
        line=np.arange(2, n + 2, dtype=np.int32),
        ids=tuple(f"r{i}" for i in range(n)),
        q=np.vstack(angles),
        position=position + rng.normal(size=position.shape) * sigma,
        wrench=np.vstack(wrenches),
    )


def dead_weight(twin: Twin):
    return [(WEIGHT, twin.com)]


def three_directions(twin: Twin):
    side = 490.0
    return [
        (WEIGHT, twin.com),
        (np.array([side, 0.0, 0.0]), twin.tcp),
        (np.array([0.0, side, 0.0]), twin.tcp),
    ]


def moved(measured: MeasurementSet, T: np.ndarray) -> MeasurementSet:
    """Return the readings in another frame."""
    return replace(measured, position=measured.position @ T[:3, :3].T + T[:3, 3])
