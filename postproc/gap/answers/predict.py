"""Tool points that a model expects for the rows of a measurement file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import SourceRef
from postproc.gap.data import samples_of
from postproc.gap.effect import registration_effects
from postproc.gap.fit import register_loaded, seen_in
from postproc.gap.robot_model import RobotModel, evaluate
from postproc.geometry import apply
from postproc.kinematics import Kinematics
from postproc.measurement import (
    MeasurementSet,
    Remark,
    frames_of,
    has_points,
    readings_of,
    set_ups,
)
from postproc.model import ModelFile
from postproc.records import dataclass
from postproc.units import MM


@dataclass(frozen=True, slots=True)
class Prediction:
    """What a model expects at the rows of a file.

    points (n, 3) [m] in the frame of the measurement; missing: effects left out; rms: misfit of
    what each row read, unknown origins and planes fitted [m]; remarks: what was wrong in the rows
    and was worked around; radius: (n,) [m] of the spheres that hold the points with 95 %, inside:
    (n,) whether the campaign reached there: both where the model knows.
    """

    points: FloatArray
    missing: tuple[str, ...]
    rms: float
    remarks: tuple[Remark, ...] = ()
    radius: FloatArray | None = None
    inside: BoolArray | None = None

    def csv(self, ids: Sequence[str]) -> bytes:
        """Return the points as CSV text.

        Args:
            ids: names of the rows.

        Returns:
            UTF-8 with the header ``id,x_mm,y_mm,z_mm``, and ``u95_mm,inside`` where they are known.
        """
        head, cells = ["x_mm", "y_mm", "z_mm"], [*self.points.T / MM]
        if self.radius is not None:
            head, cells = [*head, "u95_mm"], [*cells, self.radius / MM]
        text = [[f"{value:.6f}" for value in column] for column in cells]
        if self.inside is not None:
            head, text = [*head, "inside"], [*text, [f"{value:d}" for value in self.inside]]
        lines = [",".join(["id", *head])]
        lines += [",".join(row) for row in zip(map(_quoted, ids), *text, strict=True)]
        return ("\n".join(lines) + "\n").encode()


def predict(
    measurements: MeasurementSet,
    kinematics: Kinematics,
    cell: Cell,
    model: ModelFile | None = None,
    registered: bool = False,
) -> Prediction:
    """Return what the model expects at the rows of a measurement file.

    Args:
        measurements: commanded joints and conditions; the measured points serve the registration.
        kinematics: of the cell's robot.
        cell: with its tool.
        model: effects, and a registration that the answer is then given in.
        registered: fit the registration anew, on the rows that have three coordinates.

    Raises:
        DataError: GAP002, GAP003, MEA012, MOD004 to MOD006.
    """
    measured = np.asarray(measurements.position)
    place = SourceRef(measurements.path, int(measurements.line[0]))
    rows = set_ups(measurements)
    fixed = model.registration if model is not None else None
    if registered:
        robot = RobotModel.of(kinematics, cell, model, instrument=True)
        samples = samples_of(robot.arm, measurements)
        whole = np.flatnonzero(has_points(measurements))
        part = samples.rows(whole)
        fixed = register_loaded(
            part, measured[whole], robot.usable(part), rows.rows(whole), None, place
        )
        model = replace(model or ModelFile(), registration=fixed)
    robot = RobotModel.of(kinematics, cell, model, fixed is not None, instrument=True)
    samples = samples_of(robot.arm, measurements)
    if fixed is not None:
        samples, _ = seen_in(fixed, samples, measured, rows, place)
    points = evaluate(samples, robot.usable(samples))[0]
    if fixed is not None:
        points = apply(frames_of(fixed, rows), points)
    readings = readings_of(measurements)
    miss = readings.by_row(points, readings.start(points))
    rms = float(np.sqrt(np.mean(miss**2)))
    again = registration_effects() if registered else ()
    radius, inside = robot.certain(samples, again)
    return Prediction(points, robot.missing(samples), rms, measurements.remarks, radius, inside)


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if "," in name or '"' in name else name
