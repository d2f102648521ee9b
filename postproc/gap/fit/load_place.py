"""Where the loads of a registered campaign act: at the tool point, or at the reflector.

The wrench of a measurement counts at the tool point of the cell. Where the reflector sits elsewhere
and its place is unknown, "the tool point" of whoever filled in the file may as well be the point
that was measured: a rope tied to the reflector's nest. The rows tell which, as soon as the joints
give way by more than the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import SourceRef
from postproc.gap.data import Samples
from postproc.gap.effect import EFFECTS, registration_effects
from postproc.gap.fit.linear import Block, block_of
from postproc.gap.fit.registration import register
from postproc.gap.robot_model import States, evaluate
from postproc.measurement import SetUps, in_robroot, robust_sigma
from postproc.model import Registration

NEAR = 5e-3
"""A reflector within this [m] of the tool point makes no difference worth asking for."""
SURE = 6.0
"""Nats that the reflector has to be ahead: without proof it is the tool point."""
_FAULT = 4.0
_FINE, _LEAST = 1e-5, 1e-6
"""Noise [m] that is assumed before there is an estimate, and the least that is believed."""


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
    left = [_left(blocks, gap) for blocks, gap in sides]
    sound = np.minimum(*left) < _FAULT * np.median(np.minimum(*left))
    sigma = min(robust_sigma(size[sound]) for size in left)
    weight = sound / max(sigma, _LEAST)
    here, there = (_evidence(blocks, gap, weight) for blocks, gap in sides)
    if there < here + SURE:
        return first
    return replace(register(at_point, measured, given, set_ups, rows, source), loads_at_point=True)


def _library(
    samples: Samples, y: FloatArray, given: States
) -> tuple[tuple[Block, ...], FloatArray]:
    """Return the columns of all effects of the library, and the gap (n, 3) [m] of points ``y``."""
    point, actual = evaluate(samples, given)
    blocks = []
    for name, effect in EFFECTS:
        if not effect.is_alternative and all(samples.has(c) for c in effect.needs):
            setting = given[name].setting if name in given else effect.prepare(samples)
            blocks.append(block_of(effect, actual, setting))
    return tuple(blocks), y - point


def _left(blocks: Sequence[Block], gap: FloatArray) -> FloatArray:
    """Return what the most probable numbers of everything leave of each row (n,) [m]."""
    A, y = _flat(blocks, gap, np.full(len(gap), 1.0 / _FINE))
    theta = np.linalg.solve(A.T @ A + np.eye(A.shape[1]), A.T @ y)
    return np.asarray(np.linalg.norm((y - A @ theta).reshape(-1, 3) * _FINE, axis=1))


def _evidence(blocks: Sequence[Block], gap: FloatArray, weight: FloatArray) -> float:
    """Return the log evidence [nats], of what is the simplest that will do.

    The frames alone, with a give under the loads, or everything: a place that is right needs
    little beside it, a wrong one much.
    """
    frames = [b for b in blocks if b.name in registration_effects()]
    give = [b for b in blocks if b.effect.conditions == ("load",)]
    found = []
    for some in (frames, [*frames, *give], list(blocks)):
        A, y = _flat(some, gap, weight)
        B, b = A.T @ A + np.eye(A.shape[1]), A.T @ y
        value = float(b @ np.linalg.solve(B, b)) - float(y @ y)
        found.append(0.5 * value - 0.5 * float(np.linalg.slogdet(B)[1]))
    return max(found)


def _flat(
    blocks: Sequence[Block], gap: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return columns (3n, p) and gap (3n,) in units of the noise."""
    X = np.concatenate([block.X for block in blocks], axis=2) * weight[:, None, None]
    return X.reshape(3 * len(gap), -1), (gap * weight[:, None]).ravel()
