"""What every effect must keep, built-in or foreign.

Each check takes an effect and samples that have all columns, and raises ``PluginError`` with the
reason if the effect breaks its contract.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.errors import DataError
from postproc.gap import Effect, Kind, Samples, State, act, columns
from postproc.geometry import apply, inverse
from postproc.model import ModelFile, Registration
from postproc.testing.contract import require
from postproc.testing.made import made_samples

Check = Callable[[Effect, Samples], None]
_SMALL = 1e-3
"""Step of a finite difference, in typical sizes."""


def check_words(effect: Effect, samples: Samples) -> None:
    """It says in plain words what it is, what to do, and where the formula is from."""
    del samples
    for field in ("name", "title", "source", "action"):
        _require(bool(getattr(effect, field, "").strip()), effect, f"has no {field}")
    _require(effect.kind in list(Kind), effect, "has an unknown kind")
    _require(bool(effect.conditions), effect, "names no condition that the gap then depends on")


def check_parameters(effect: Effect, samples: Samples) -> None:
    """Its parameters have distinct names, positive typical sizes, and zero inside their bounds."""
    parameters = effect.parameters(samples.arm, effect.prepare(samples))
    names = [p.name for p in parameters]
    _require(len(set(names)) == len(names) > 0, effect, "has no parameters, or two of one name")
    for p in parameters:
        _require(0.0 < p.typical < np.inf, effect, f"{p.name}: typical size must be positive")
        _require(p.lower <= 0.0 <= p.upper, effect, f"{p.name}: zero must be inside the bounds")
        _require(0 <= p.joint <= 6, effect, f"{p.name}: no such joint")


def check_zero(effect: Effect, samples: Samples) -> None:
    """Parameters of zero move nothing."""
    setting = effect.prepare(samples)
    theta = np.zeros(len(effect.parameters(samples.arm, setting)))
    moved = act(samples, [(effect, State(theta, setting))])[0] - samples.point
    _require(float(np.abs(moved).max()) < 1e-12, effect, "moves the point with zero parameters")


def check_columns(effect: Effect, samples: Samples) -> None:
    """Its columns are the derivative of the exact model."""
    setting = effect.prepare(samples)
    parameters = effect.parameters(samples.arm, setting)
    linear = columns(samples, effect.basis(samples, setting))
    for k, p in enumerate(parameters):
        step = np.zeros(len(parameters))
        step[k] = _SMALL * p.typical
        ends = [act(samples, [(effect, State(s * step, setting))])[0] for s in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * step[k])
        size = float(np.abs(slope).max()) + 1e-9
        off = float(np.abs(slope - linear[:, :, k]).max()) / size
        _require(off < 1e-3, effect, f"{p.name}: column is {off:.1e} off the exact derivative")


def check_needs(effect: Effect, samples: Samples) -> None:
    """Without a needed column it says so; with the others missing it still works."""
    for column in effect.needs:
        try:
            effect.basis(samples.without(column), effect.prepare(samples))
        except DataError:
            continue
        _require(False, effect, f"it does not miss its column {column}")
    every = ("direction", "qd", "wrench", "time", "temperature", *samples.extra)
    bare = samples.without(*(name for name in every if name not in effect.needs))
    try:
        effect.basis(bare, effect.prepare(bare))
    except DataError as error:
        _require(False, effect, f"it {error.message} without saying so")


def check_file(effect: Effect, samples: Samples) -> None:
    """What it writes into a model file it reads back, to the same displacement.

    Frames of further set-ups stand in the registration of the file, not in a table of their own.
    """
    if effect.is_alternative or effect.of_several:
        return
    setting = effect.prepare(samples)
    parameters = effect.parameters(samples.arm, setting)
    rng = np.random.default_rng(2)
    drawn = np.abs(rng.normal(size=len(parameters))) * [p.typical for p in parameters]
    state = State(drawn, setting)
    table = effect.write(state, samples.arm)
    again = effect.read(ModelFile({effect.name: table}), samples.arm)
    ends = [act(samples, [(effect, s)])[0] for s in (state, again)]
    off = float(np.abs(ends[0] - ends[1]).max())
    _require(off < 1e-9, effect, f"a model file changes it by {off:.1e} m")


def check_registration(effect: Effect, samples: Samples) -> None:
    """A registration that takes its numbers in moves the measured points as it does."""
    if effect.kind != Kind.REGISTRATION or samples.set_up is None:
        return
    setting = effect.prepare(samples)
    theta = np.array([p.typical for p in effect.parameters(samples.arm, setting)])
    T_robroot_flange = samples.arm.kinematics.fk(samples.q)
    p_flange = apply(inverse(T_robroot_flange), samples.point)
    station, reflector = samples.set_up.T
    first = [int(np.argmax(reflector == r)) for r in range(int(reflector.max()) + 1)]
    start = Registration(
        np.eye(4),
        p_flange[first[0]],
        stations={str(s): np.eye(4) for s in range(int(station.max()) + 1)},
        reflectors={str(r): p_flange[row] for r, row in enumerate(first)},
    )
    end = effect.registered(start, theta)
    T = np.array(list(end.stations.values()))[station]
    points = np.array(list(end.reflectors.values()))[reflector]
    seen = apply(T, apply(T_robroot_flange, points))
    off = np.abs(seen - act(samples, [(effect, State(theta, setting))])[0]).max()
    _require(float(off) < 1e-5, effect, f"a registration with it moves a point by {off:.1e} m more")


CHECKS: tuple[Check, ...] = (
    check_words,
    check_parameters,
    check_zero,
    check_columns,
    check_needs,
    check_file,
    check_registration,
)
"""All that is asked of an effect."""


def check_effect(effect: Effect, samples: Samples | None = None) -> None:
    """Hold an effect to its contract.

    Args:
        effect: the part that the entry point names.
        samples: rows with all columns, at postures where the effect shows; default: made-up ones.

    Raises:
        PluginError: PLG004 with what it breaks.
    """
    rows = made_samples() if samples is None else samples
    for check in CHECKS:
        check(effect, rows)


def _require(good: bool, effect: Effect, reason: str) -> None:
    require(good, f"effect {effect.name!r}", reason)
