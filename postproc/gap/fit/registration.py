"""The registration of a campaign on the arm of a model, and with frames that were fitted.

The wrench of a measurement counts at the tool point of the cell. Where the reflector sits elsewhere
and its place is unknown, "the tool point" of whoever filled in the file may as well be the point
that was measured: a rope tied to the reflector's nest. The rows tell which, as soon as the joints
give way by more than the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import SourceRef
from postproc.gap.data import Samples
from postproc.gap.effect import EFFECTS, registration_effects
from postproc.gap.fit.waves import Projection
from postproc.gap.robot_model import States, columns, effect_of, evaluate
from postproc.measurement import (
    SetUps,
    fit_registration,
    in_robroot,
    robust_sigma,
    unloaded_rows,
)
from postproc.model import Registration

_ENOUGH_OF_STATION = 6
"""Unloaded rows of one station or reflector that suffice without its loaded ones."""
_ROUNDS = 5
_SETTLED = 1e-9
"""Change of the point [m] that ends the fit: what the model does at it has settled."""
NEAR = 5e-3
"""A reflector within this [m] of the tool point makes no difference worth asking for."""
SURE = 6.0
"""Nats that the reflector has to be ahead: without proof it is the tool point."""
_FAULT = 4.0
_FINE, _LEAST = 1e-5, 1e-6
"""Noise [m] that is assumed before there is an estimate, and the least that is believed."""


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


def register_loaded(
    samples: Samples,
    measured: FloatArray,
    given: States,
    set_ups: SetUps,
    rows: BoolArray | None = None,
    source: SourceRef | None = None,
) -> Registration:
    """Fit the measured frame, the measured point, and which of the two points carries the loads.

    Args:
        samples: rows; their arm's points are the start.
        measured: (n, 3) points in the measured frame [m].
        given: effects that the model has already; they stay.
        set_ups: station and reflector of each row.
        rows: (n,) to register on; None: all.
        source: of the measurements, for the message.

    Raises:
        DataError: MEA012 if there are too few postures.
    """
    first = register(samples, measured, given, set_ups, rows, source)
    place = first.p_flange_point
    aside = float(np.linalg.norm(place - samples.arm.p_flange_load))
    if samples.wrench is None or not bool(np.any(samples.wrench)) or aside < NEAR:
        return first
    if len(set_ups.reflectors) > 1:
        return first
    at_point = samples.with_points(load=place)
    y = in_robroot(first, measured, set_ups)
    sides = [_library(rows.with_points(measured=place), y, given) for rows in (samples, at_point)]
    left = [_left(*side) for side in sides]
    sound = np.minimum(*left) < _FAULT * np.median(np.minimum(*left))
    sigma = min(robust_sigma(size[sound]) for size in left)
    weight = sound / max(sigma, _LEAST)
    here, there = (_evidence(*side, weight) for side in sides)
    if there < here + SURE:
        return first
    return replace(register(at_point, measured, given, set_ups, rows, source), loads_at_point=True)


Library = Mapping[str, FloatArray]
"""Columns (n, 3, p) of each effect, in metres per typical size."""


def _library(samples: Samples, y: FloatArray, given: States) -> tuple[Library, FloatArray]:
    """Return the columns of all effects of the library, and the gap (n, 3) [m] of points ``y``."""
    point, actual = evaluate(samples, given)
    columns_of = {}
    for name, effect in EFFECTS:
        if not effect.is_alternative and all(samples.has(c) for c in effect.needs):
            setting = given[name].setting if name in given else effect.prepare(samples)
            typical = [p.typical for p in effect.parameters(actual.arm, setting)]
            columns_of[name] = columns(actual, effect.basis(actual, setting)) * np.array(typical)
    return columns_of, y - point


def _left(library: Library, gap: FloatArray) -> FloatArray:
    """Return what the most probable numbers of everything leave of each row (n,) [m]."""
    X = np.concatenate(list(library.values()), axis=2)
    rest = Projection(X, gap, np.full(len(gap), 1.0 / _FINE)).rest
    return np.asarray(np.linalg.norm(rest.reshape(-1, 3) * _FINE, axis=1))


def _evidence(library: Library, gap: FloatArray, weight: FloatArray) -> float:
    """Return the log evidence [nats] of the simplest that will do: a wrong place needs much."""
    frames = [name for name in library if name in registration_effects()]
    give = [name for name in library if effect_of(name).conditions == ("load",)]
    nothing = Projection(np.zeros((len(gap), 3, 0)), gap, weight)
    found = []
    for some in (frames, [*frames, *give], library):
        X = np.concatenate([library[name] for name in some], axis=2) * weight[:, None, None]
        found.append(nothing.gain(X.reshape(len(nothing.y), -1), nothing.y))
    return max(found) - 0.5 * float(nothing.y @ nothing.y)
