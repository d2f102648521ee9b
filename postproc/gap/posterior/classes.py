"""What a rest is a function of, where no effect is its cause.

A joint's angle, time, place, load, approach, speed, orientation, temperature: each is a group of
columns of one size, fitted by its marginal likelihood, so that groups of different size compare
fairly. The largest is taken, and the others are judged by what it leaves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.fit import STANDING, Noise
from postproc.records import dataclass

_STEPS = 16
"""Moments at which a step is tried."""
_FORMULAS = {
    ("joint", "linear"),
    ("joint", "once per turn"),
    ("joint", "twice per turn"),
    ("joint", "once per turn, of a bearing"),
    ("load", "proportional"),
    ("approach", "constant"),
    ("speed", "proportional"),
    ("temperature", "proportional"),
    ("station", "ramp"),
    ("station", "warm-up"),
}
"""Class, or what of it, and shape that effects of the library have, or are told from otherwise."""
LOUD = 1.5
"""Ratio of wander and white noise from which the wander is a course of time that nothing explains,
and no noise."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the rest: its class, what of it, the shape, 3D rms [m] and evidence [nats].

    The evidence is NaN where the noise tells of it, and no fit.
    """

    kind: str
    of: str
    shape: str
    rms: float
    gain: float


@dataclass(frozen=True, slots=True)
class Group:
    """Columns (n, 3, m) of a class, each of unit rms [m]."""

    kind: str
    of: str
    shape: str
    X: FloatArray
    price: float = 0.0

    @property
    def is_rival(self) -> bool:
        """Whether no effect has this formula."""
        return _FORMULAS.isdisjoint({(self.kind, self.shape), (self.of, self.shape)})


def wandering(noise: Noise, rest: Sequence[Part]) -> tuple[Part, ...]:
    """Return the parts of what is left, largest first, and a wander too large to be noise.

    Args:
        noise: of the campaign.
        rest: parts.
    """
    size = float(np.sqrt(3.0)) * noise.wander
    parts = list(rest)
    has = any(part.kind == "time" and part.rms >= size for part in rest)
    if noise.wander > LOUD * noise.white and not has:
        parts.append(Part("time", "station", "wander", size, float("nan")))
    return tuple(sorted(parts, key=lambda p: (-p.rms, p.kind, p.of)))


def groups_of(samples: Samples, moments: FloatArray | None = None) -> list[Group]:
    """Return all groups, columns of unit size.

    Args:
        samples: rows.
        moments: of steps [s]; None: spread over the rows.
    """
    parts = (
        _of_joints(samples),
        _of_time(samples, moments_of(samples) if moments is None else moments),
        _of_place(samples),
        _of_load(samples),
        _of_motion(samples),
        _of_warmth(samples),
        _of_conditions(samples),
    )
    return [g for part in parts for g in part]


def _unit(X: FloatArray) -> FloatArray:
    """Scale columns to unit rms, each; those that are nothing are left out."""
    size = np.sqrt(np.mean(np.sum(X**2, axis=1), axis=0))
    good = size > 1e-12
    return np.asarray(X[:, :, good] / size[good])


def _vectors(f: FloatArray) -> FloatArray:
    """Return (n, 3, 3 k): functions (n, k) along each axis."""
    n, k = f.shape
    return np.asarray(np.einsum("ij,nk->nijk", np.eye(3), f).reshape(n, 3, 3 * k))


def _turns(samples: Samples, joint: int, f: FloatArray) -> FloatArray:
    """Return (n, 3, k): functions (n, k) as turns of one joint."""
    return np.asarray(samples.jacobian[:, :, joint, None] * f[:, None, :])


def _of_joints(samples: Samples) -> Iterator[Group]:
    spread = (samples.q - samples.q.mean(axis=0)) / (np.std(samples.q, axis=0) + 1e-9)
    yield Group("joint", "joints", "linear", _unit(samples.jacobian * spread[:, None, :]))
    for joint in range(6):
        q = samples.q[:, joint]
        if float(np.ptp(q)) < STANDING:
            continue
        name, x = f"q{joint + 1}", (q - q.mean()) / np.std(q)
        yield Group("joint", name, "linear", _unit(_turns(samples, joint, x[:, None])))
        bent = np.column_stack([x**2 - 1.0, x**3 - 3.0 * x])
        yield Group("joint", name, "curved", _unit(_turns(samples, joint, bent)))
        for n, words in ((1, "once per turn"), (2, "twice per turn")):
            f = np.column_stack([np.cos(n * q), np.sin(n * q)])
            yield Group("joint", name, words, _unit(_turns(samples, joint, f)))
            yield Group("joint", name, f"{words}, of a bearing", _unit(_bearing(samples, joint, f)))


def _bearing(samples: Samples, joint: int, f: FloatArray) -> FloatArray:
    """Return shifts and tilts (n, 3, 6 k) of what a joint's bearing carries, by functions."""
    frames = samples.frames[:, joint, :3, :3]
    lever = samples.point - samples.frames[:, joint + 1, :3, 3]
    tilts = np.stack([np.cross(frames[:, :, k], lever) for k in range(3)], axis=2)
    both = np.concatenate([frames, tilts], axis=2)
    return np.asarray(np.einsum("nim,nk->nimk", both, f).reshape(len(f), 3, -1))


def moments_of(samples: Samples) -> FloatArray:
    """Return the moments [s] at which a step is tried."""
    return np.asarray(np.quantile(samples.course, np.linspace(0.05, 0.95, _STEPS)))


def _of_time(samples: Samples, moments: FloatArray) -> Iterator[Group]:
    time = samples.course
    if float(np.ptp(time)) <= 0.0:
        return
    part = (time - time.min()) / float(np.ptp(time))
    forms = [("ramp", part), ("warm-up", 1.0 - np.exp(-4.0 * part))]
    for shape, f in forms:
        yield Group("time", "station", shape, _unit(_moved(samples, f)))
        every = [_turns(samples, joint, f[:, None]) for joint in range(6)]
        yield Group("time", "joints", shape, _unit(np.concatenate(every, axis=2)))
    knots = np.linspace(0.0, 1.0, 13)
    hats = np.maximum(1.0 - np.abs(part[:, None] - knots) * 12.0, 0.0)
    yield Group("time", "station", "wander", _unit(_vectors(hats)))
    price = float(np.log(_STEPS))
    for at in moments:
        f = (time > at).astype(float)
        if not 0.0 < f.mean() < 1.0:
            continue
        shape = f"step at row {at:.0f}" if samples.time is None else f"step at {at:.0f} s"
        yield Group("time", "station", shape, _unit(_moved(samples, f)), price)
        R = samples.frames[:, 6, :3, :3] * f[:, None, None]
        yield Group("time", "reflector", shape, _unit(R), price)
        for joint in range(6):
            X = _unit(_turns(samples, joint, f[:, None]))
            yield Group("time", f"q{joint + 1}", shape, X, price)


def _moved(samples: Samples, f: FloatArray) -> FloatArray:
    """Return shift and turn (n, 3, 6) of the measured frame by a function (n,)."""
    turn = np.stack([np.cross(np.eye(3)[k], samples.point) for k in range(3)], axis=2)
    shift = np.tile(np.eye(3), (len(f), 1, 1))
    return np.asarray(np.concatenate([shift, turn], axis=2) * f[:, None, None])


def _of_place(samples: Samples) -> Iterator[Group]:
    x = (samples.point - samples.point.mean(axis=0)) / (np.std(samples.point) + 1e-9)
    yield Group("place", "x, y, z", "scale", _unit(_vectors(x)))
    bent = np.column_stack([x**2, x[:, :1] * x[:, 1:], x[:, 1] * x[:, 2]])
    yield Group("place", "x, y, z", "curved", _unit(_vectors(np.column_stack([x, bent]))))
    if float(np.ptp(samples.q[:, 3:], axis=0).max()) < STANDING:
        return
    f = np.concatenate([fn(samples.q[:, 3:]) for fn in (np.cos, np.sin)], axis=1)
    R = samples.frames[:, 6, :3, :3]
    X = np.einsum("nij,nk->nijk", R, f).reshape(len(f), 3, -1)
    yield Group("orientation", "wrist", "once per turn", _unit(X))


def _of_load(samples: Samples) -> Iterator[Group]:
    if samples.wrench is None or not np.any(samples.wrench):
        return
    force, J = samples.wrench[:, :3], samples.jacobian
    torque = samples.load_torque() * samples.arm.reference.c_joint
    size = np.linalg.norm(force, axis=1) / (np.linalg.norm(force, axis=1).max() + 1e-9)
    yield Group("load", "joints", "proportional", _unit(J * torque[:, None, :]))
    hard = J * (torque * size[:, None])[:, None, :]
    yield Group("load", "joints", "hardening", _unit(hard))
    yield Group("load", "place", "proportional", _unit(_vectors(force)))
    x = (samples.point - samples.point.mean(axis=0)) / (np.std(samples.point) + 1e-9)
    over = np.einsum("nk,nm->nkm", force, x).reshape(len(x), 9)
    yield Group("load", "place", "changes over the place", _unit(_vectors(over)))
    if samples.past is not None:
        past = samples.past.reshape(len(J), -1, 6) * samples.arm.reference.c_joint
        tails = [J * past[:, k, None, :] for k in range(past.shape[1])]
        yield Group("load", "joints", "with a time tail", _unit(np.concatenate(tails, axis=2)))
    if samples.time is not None:
        late = (samples.time - samples.time.min()) / (np.ptp(samples.time) + 1e-9)
        aged = J * (torque * late[:, None])[:, None, :]
        yield Group("load", "joints", "grows with time", _unit(aged))


def _of_motion(samples: Samples) -> Iterator[Group]:
    J = samples.jacobian
    if samples.direction is not None and np.any(samples.direction):
        d = samples.direction
        for joint in range(6):
            X = _unit(_turns(samples, joint, d[:, joint : joint + 1]))
            yield Group("approach", f"q{joint + 1}", "constant", X)
        yield Group("approach", "joints", "constant", _unit(J * d[:, None, :]))
        heavy = d * (
            1.0 + np.cos(samples.q[:, 1:2]) + np.cos(samples.q[:, 1:2] + samples.q[:, 2:3])
        )
        both = np.concatenate([J * d[:, None, :], J * heavy[:, None, :]], axis=2)
        yield Group("approach", "joints", "grows with load", _unit(both))
    if samples.qd is not None and np.any(samples.qd):
        v = samples.qd
        yield Group("speed", "joints", "proportional", _unit(J * v[:, None, :]))
        yield Group("speed", "joints", "quadratic", _unit(J * (v * np.abs(v))[:, None, :]))


def _of_warmth(samples: Samples) -> Iterator[Group]:
    warm = samples.temperature
    if warm is None or float(np.ptp(warm)) <= 0.0:
        return
    f = (warm - warm.mean()) / np.std(warm)
    X = np.concatenate([_moved(samples, f), samples.jacobian * f[:, None, None]], axis=2)
    yield Group("temperature", "arm", "proportional", _unit(X))


def _of_conditions(samples: Samples) -> Iterator[Group]:
    for name, values in samples.extra.items():
        array = np.asarray(values)
        if array.dtype.kind not in "fiu" or not np.all(np.isfinite(array)) or np.ptp(array) == 0:
            continue
        f = (array - array.mean()) / np.std(array)
        yield Group("condition", name, "proportional", _unit(_vectors(f[:, None])))
