"""Shared pieces of the gap tests: one cell, its arm, samples with every column."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from postproc.cell.cell import Cell
from postproc.cell.file import load_cell
from postproc.gap.data.dataset import Samples, make_samples
from postproc.gap.robot_model import RobotModel
from postproc.kinematics import Kinematics, build
from tests.gap import synthetic
from tests.places import PANEL_CELL


@pytest.fixture(scope="session")
def world() -> ModuleType:
    """The made-up robot."""
    return synthetic


@pytest.fixture(scope="session")
def cell() -> Cell:
    return load_cell(PANEL_CELL)


@pytest.fixture(scope="session")
def kinematics(cell: Cell) -> Kinematics:
    return build(cell.robot)


def samples_from(cell: Cell, kinematics: Kinematics, data: dict) -> Samples:
    arm = RobotModel.of(kinematics, cell).arm
    return make_samples(
        arm,
        data["q"],
        wrench=data["wrench"],
        direction=data["direction"],
        qd=data["qd"],
        time=data["time"],
        temperature=data["temp"],
    )


@pytest.fixture(scope="session")
def samples(cell: Cell, kinematics: Kinematics) -> Samples:
    data = synthetic.campaign(np.random.default_rng(8), 60)
    return samples_from(cell, kinematics, data)


@pytest.fixture
def samples_of_data(cell: Cell, kinematics: Kinematics):
    return lambda data: samples_from(cell, kinematics, data)
