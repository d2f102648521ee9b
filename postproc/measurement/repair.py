"""Dirt in a campaign that the arm's geometry gives away: copies, wrong units, mixed-up readings.

Each is found by what undoing it does: a reading that lies metres beside the arm and within
millimetres once it is taken in inches was in inches. What is found is named and worked around; what
is not sure stays as it is and is judged later with the other measuring faults.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import DataError
from postproc.geometry import apply
from postproc.kinematics import Kinematics
from postproc.measurement.readings import has_points
from postproc.measurement.registration import fit_registration, frames_of, points_of
from postproc.measurement.rows import MeasurementSet, Remark, set_ups
from postproc.model import Registration
from postproc.units import DEG, MM, SINGLE

LENGTHS = {name: SINGLE[name].factor / MM for name in ("metres", "inches", "centimetres")}
"""Units of length [mm] that readings are mistaken in."""
FAR = 20.0 * MM
"""Distance from the arm from which something is mistaken, not inexact."""
CLEAR = 10.0
"""How many times nearer a row must lie to be taken otherwise."""
_KELVIN = 273.15
_HOTTEST = 150.0
"""No arm is that warm [degC]."""

COLUMN = "tool_no"


def repaired(
    measured: MeasurementSet,
    kinematics: Kinematics,
    cell: Cell,
    registered: bool,
    frame: Registration | None,
) -> MeasurementSet:
    """Return the rows in the units of their columns, neighbours sorted out, none left out.

    Args:
        measured: the campaign.
        kinematics: of the robot.
        cell: with the tool that is expected to be measured.
        registered: the measured frame is unknown: each guess is registered again.
        frame: the registration that holds otherwise, None for the robot root.
    """
    measured = _in_celsius(measured)
    seen = _Seen(kinematics, cell, registered, frame)
    distance = seen.distance(measured)
    if float(np.median(distance)) > FAR:
        measured = _whole_units(measured, seen, float(np.median(distance)))
        distance = seen.distance(measured)
    limit = max(FAR, CLEAR * float(np.median(distance)))
    if np.any(distance > limit):
        measured = _swapped_back(measured, seen, distance, limit)
        distance = seen.distance(measured)
        measured = _units_of_rows(measured, seen, distance, limit)
    return measured


def without_copies(measured: MeasurementSet) -> MeasurementSet:
    """Leave rows out that repeat an earlier one to the last digit: nobody read them."""
    fields = ("q", "position", "along", "way", "length", "origin", "direction", "qd", "wrench")
    parts = [v for name in fields if (v := getattr(measured, name)) is not None]
    labels = [v for v in (measured.from_id, measured.plane) if v is not None]
    parts += [np.unique(np.array(v), return_inverse=True)[1] for v in labels]
    whole = np.nan_to_num(np.column_stack([*parts, set_ups(measured).unit]))
    first = np.unique(whole, axis=0, return_index=True)[1]
    kept = np.zeros(len(measured), dtype=bool)
    kept[first] = True
    if kept.all():
        return measured
    text = "the same to the last digit as an earlier row; counted once"
    return _noted(measured.rows(kept), "copy", measured, ~kept, text)


def _in_celsius(measured: MeasurementSet) -> MeasurementSet:
    """Take temperatures beyond any arm's as kelvin, or as degrees Fahrenheit where they are."""
    warm = measured.temperature
    if warm is None:
        return measured
    usual = float(np.median(warm))
    kelvin = warm > _HOTTEST
    fahrenheit = ~kelvin & (np.abs(warm - usual) > 30.0)
    fahrenheit &= np.abs((warm - 32.0) / 1.8 - usual) < 8.0
    for rows, unit in ((kelvin, "kelvin"), (fahrenheit, "degrees Fahrenheit")):
        if not np.any(rows):
            continue
        right = warm - _KELVIN if unit == "kelvin" else (warm - 32.0) / 1.8
        warm = np.where(rows, right, warm)
        text = f"temp_C is in {unit}; converted"
        measured = _noted(replace(measured, temperature=warm), "unit", measured, rows, text)
    return measured


class _Seen:
    """How far rows lie from the arm, under one guess or another."""

    def __init__(
        self, kinematics: Kinematics, cell: Cell, registered: bool, frame: Registration | None
    ) -> None:
        self.kinematics = kinematics
        self.tcp = np.asarray(cell.tool.T_flange_tcp[:3, 3])
        self.tools = tool_points(cell)
        self.registered = registered
        self.frame = frame
        self.fitted: Registration | None = None

    def register(self, measured: MeasurementSet) -> None:
        """Fit the frame to the rows as they are now."""
        measured = measured.rows(has_points(measured))
        flange = self.kinematics.fk(measured.q)
        self.fitted = fit_registration(flange, measured.position, self.tcp, rows=set_ups(measured))

    def distance(self, measured: MeasurementSet, again: bool = True) -> FloatArray:
        """Return how far each row (n,) lies from the arm [m]; infinite if none can be said.

        A row without three coordinates lies as far as usual: nothing is mistaken in it.
        """
        rows = set_ups(measured)
        try:
            if self.registered and (again or self.fitted is None):
                self.register(measured)
            frame = self.fitted if self.registered else self.frame
            own = points_of_rows(self.tools, measured.extra, self.tcp)
            tcp = self.tcp if own is None else own
            point = tcp if frame is None else points_of(frame, rows)
            T = np.eye(4) if frame is None else frames_of(frame, rows)
        except (DataError, KeyError, np.linalg.LinAlgError):
            return np.full(len(measured), np.inf if again else 0.0)
        expected = apply(T, apply(self.kinematics.fk(measured.q), point))
        away = np.linalg.norm(measured.position - expected, axis=1)
        whole = has_points(measured)
        usual = np.median(away[whole]) if whole.any() else 0.0
        return np.where(whole, away, usual)


def _whole_units(measured: MeasurementSet, seen: _Seen, now: float) -> MeasurementSet:
    """Take whole columns in another unit where that brings the rows to the arm."""
    best, found, text = now, measured, ""
    for axes in (a for k in (3, 1, 2) for a in itertools.combinations(range(3), k)):
        for unit, factor in {"millimetres": 1.0, **LENGTHS}.items():
            for turned in (False, True):
                if factor == 1.0 and (not turned or len(axes) < 3):
                    continue
                scale = np.ones(3)
                scale[list(axes)] = factor
                q = np.asarray(measured.q) / DEG if turned else measured.q
                if turned and float(np.abs(q).max()) > 7.0:
                    continue
                trial = replace(measured, q=q, position=measured.position * scale)
                left = float(np.median(seen.distance(trial)))
                if left < min(best / CLEAR if not text else best * 0.7, 5.0 * FAR):
                    names = ", ".join("xyz"[a] for a in axes)
                    said = [f"{names} in {unit}"] if factor != 1.0 else []
                    said += ["joint angles in radians"] if turned else []
                    best, found, text = left, trial, " and ".join(said)
    if not text:
        return measured
    everything = np.ones(len(measured), dtype=bool)
    return _noted(found, "unit", measured, everything, f"{text}; converted")


def _swapped_back(
    measured: MeasurementSet, seen: _Seen, distance: FloatArray, limit: float
) -> MeasurementSet:
    """Exchange the readings of neighbouring rows that both fit the other's posture."""
    position = np.array(measured.position)
    swapped = np.zeros(len(measured), dtype=bool)
    order = np.arange(len(measured))
    for step in (1, 2):
        other = np.minimum(order + step, len(order) - 1)
        crossed = seen.distance(replace(measured, position=measured.position[other]), again=False)
        back = np.maximum(order - step, 0)
        returned = seen.distance(replace(measured, position=measured.position[back]), again=False)
        for row in range(len(measured) - step):
            pair = [row, row + step]
            if swapped[pair].any() or not np.all(distance[pair] > limit):
                continue
            if max(crossed[row], returned[row + step]) < limit / 2.0:
                position[pair] = position[pair[::-1]]
                swapped[pair] = True
    if not swapped.any():
        return measured
    text = "readings of neighbouring rows were swapped; exchanged"
    return _noted(replace(measured, position=position), "swapped", measured, swapped, text)


def _units_of_rows(
    measured: MeasurementSet, seen: _Seen, distance: FloatArray, limit: float
) -> MeasurementSet:
    """Take single rows in another unit where that brings them to the arm."""
    far: BoolArray = np.asarray(distance > limit)
    for unit, factor in LENGTHS.items():
        trial = replace(measured, position=measured.position * factor)
        good = far & (seen.distance(trial, again=False) < limit / 2.0)
        if good.any():
            position = np.where(good[:, None], trial.position, measured.position)
            text = f"x, y, z in {unit}; converted"
            measured = _noted(replace(measured, position=position), "unit", measured, good, text)
            far &= ~good
    turned = replace(measured, q=np.asarray(measured.q) / DEG)
    good = far & (np.abs(turned.q).max(axis=1) < 7.0)
    good &= seen.distance(turned, again=False) < limit / 2.0
    if good.any():
        q = np.where(good[:, None], turned.q, measured.q)
        text = "joint angles in radians; converted"
        measured = _noted(replace(measured, q=q), "unit", measured, good, text)
    return measured


def _noted(
    now: MeasurementSet, kind: str, before: MeasurementSet, rows: BoolArray, text: str
) -> MeasurementSet:
    """Return rows with a remark on some of those that were there before."""
    ids = tuple(before.ids[k] for k in np.flatnonzero(rows))
    return replace(now, remarks=(*now.remarks, Remark(kind, ids, text)))


def tool_points(cell: Cell) -> dict[str, FloatArray]:
    """Return the tool point (3,) in the flange [m] of each tool of a cell, by its number."""
    return {str(tool.number): np.asarray(tool.T_flange_tcp[:3, 3]) for tool in cell.tools}


def labels_of(column: Iterable[object]) -> list[str]:
    """Return the labels of rows; numbers that a table wrote with a point are the same without."""
    return [str(label).removesuffix(".0") for label in column]


def points_of_rows(
    tools: Mapping[str, FloatArray], extra: Mapping[str, Any], default: FloatArray
) -> FloatArray | None:
    """Return the tool point (n, 3) of each row, None where all rows have the one in work.

    A number that the cell does not have is the tool in work: then it is a condition alone.

    Args:
        tools: as ``tool_points`` gives them.
        extra: logged conditions of the rows.
        default: (3,) tool point of the tool in work.
    """
    labels = extra.get(COLUMN)
    if labels is None or len(tools) < 2:
        return None
    return np.array([tools.get(label, default) for label in labels_of(labels)])
