"""The registration of a campaign on the arm of a model, and with frames that were fitted."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import SourceRef
from postproc.gap.data import Samples
from postproc.gap.robot_model import States, effect_of, evaluate
from postproc.measurement import SetUps, fit_registration, unloaded_rows
from postproc.model import Registration

_ENOUGH_OF_STATION = 6
"""Unloaded rows of one station or reflector that suffice without its loaded ones."""
_ROUNDS = 5
_SETTLED = 1e-9
"""Change of the point [m] that ends the fit: what the model does at it has settled."""


def rows_on_the_arm(samples: Samples, given: States) -> BoolArray:
    """Return the rows (n,) whose loads the model counts, or that have none.

    All of them where the model knows how far the arm gives under loads.
    """
    knows_loads = any("wrench" in effect_of(name).needs for name in given)
    return unloaded_rows(samples.q, None if knows_loads else samples.wrench)


def register(
    samples: Samples,
    measured: FloatArray,
    given: States,
    set_ups: SetUps,
    rows: BoolArray | None = None,
    source: SourceRef | None = None,
) -> Registration:
    """Fit the measured frame and the measured point to the arm of the given model.

    Args:
        samples: rows; their arm's point is the start.
        measured: (n, 3) points in the measured frame [m].
        given: effects that the model has already; they stay.
        set_ups: station and reflector of each row.
        rows: (n,) to register on; None: all.
        source: of the measurements, for the message.

    Raises:
        DataError: MEA012 if there are too few postures.
    """
    if rows is not None:
        rows = _of_every_station(rows, set_ups)
        samples, measured, set_ups = samples.rows(rows), measured[rows], set_ups.rows(rows)
    start = np.asarray(samples.arm.p_flange_point)
    place = start
    for _ in range(_ROUNDS):
        flange = _flange(samples, place, given)
        found = fit_registration(flange, measured, start, source, set_ups)
        change = float(np.linalg.norm(found.p_flange_point - place))
        place = found.p_flange_point
        if not given or change < _SETTLED:
            break
    return found


def _of_every_station(rows: BoolArray, set_ups: SetUps) -> BoolArray:
    """Return the rows, and all those of a station or reflector that has few among them."""
    found = rows.copy()
    for label in (set_ups.station, set_ups.reflector):
        for k in np.unique(label):
            here = label == k
            if rows[here].sum() < _ENOUGH_OF_STATION:
                found |= here
    return found


def _flange(samples: Samples, place: FloatArray, given: States) -> FloatArray:
    """Return where the flange (n, 4, 4) stands, seen from a point of it: its turn there is left."""
    here = samples.with_points(measured=place)
    point, actual = evaluate(here, given)
    T = np.array(samples.arm.kinematics.fk(actual.q))
    T[:, :3, 3] += point - actual.point
    return T


def moved_by(registration: Registration, states: States) -> Registration:
    """Return a registration that takes in what was fitted of its frames."""
    for name, state in states.items():
        registration = effect_of(name).registered(registration, state.theta)
    return registration
