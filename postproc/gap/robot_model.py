"""The forward model: nominal arm plus effects, shared by predict, convert and diagnose.

All effects act together: joint-space effects are added to the commanded angles, link effects are
small motions between the links, both go through the exact forward kinematics; a load that turns
the joints is put in equilibrium with the pose that results, by fixed point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import DataError
from postproc.gap.data import Arm, Samples, make_samples, reference_of
from postproc.gap.effect import EFFECTS, Basis, Effect, Setting, State, Table
from postproc.geometry import apply, inverse, rotation_from_vector, skew
from postproc.kinematics import Kinematics
from postproc.measurement import tool_points
from postproc.model import ModelFile, Reach, Registration
from postproc.records import dataclass
from postproc.stiffness import Locate, StiffnessField

_FIXED_POINT_STEPS = 8
"""Each step shrinks the error by the deflection over the arm's length, 1e-3 to 1e-2."""
_SETTLED = 1e-10
"""Turn [rad] of any joint that ends the fixed point."""

States = Mapping[str, State]


def arm_of(kinematics: Kinematics, cell: Cell, seen: Registration | None = None) -> Arm:
    """Return the nominal arm of a cell; without a registration the tool point is measured."""
    tcp = np.asarray(cell.tool.T_flange_tcp[:3, 3])
    point = tcp if seen is None else np.asarray(seen.p_flange_point)
    load = point if seen is not None and seen.loads_at_point else tcp
    tools = {} if seen is not None and seen.loads_at_point else tool_points(cell)
    return Arm(kinematics, point, load, reference_of(kinematics, cell), tools, seen is None)


def tool_point(samples: Samples, states: States) -> FloatArray:
    """Return (n, 3) the real point [m], axes of robroot.

    Args:
        samples: at the commanded angles.
        states: effects by name; a number that is NaN (not seen) counts as nothing.

    Raises:
        DataError: GAP001 if an effect needs a column that was not logged.
    """
    return evaluate(samples, states)[0]


def evaluate(samples: Samples, states: States) -> tuple[FloatArray, Samples]:
    """Return the real point (n, 3) and the samples at the angles that the joints really take."""
    return act(samples, [(effect_of(name), state) for name, state in states.items()])


def act(samples: Samples, active: Sequence[tuple[Effect, State]]) -> tuple[FloatArray, Samples]:
    """Return what ``evaluate`` does, for effects that need not be registered."""
    steps = _FIXED_POINT_STEPS if any(effect.equilibrium for effect, _ in active) else 1
    fixed = [(e, s, e.basis(samples, s.setting)) for e, s in active if not e.equilibrium]
    loaded = [(e, s) for e, s in active if e.equilibrium]
    actual = samples
    link = _zeros_link(samples)
    point = np.zeros((len(samples), 3))
    last: FloatArray | None = None
    for _ in range(steps):
        parts = fixed + [(e, s, e.basis(actual, s.setting)) for e, s in loaded]
        turn, link, point = _sum(samples, parts)
        actual = samples.at(samples.q + turn) if bool(np.any(turn)) else samples
        if last is not None and float(np.abs(turn - last).max(initial=0.0)) < _SETTLED:
            break
        last = turn
    return _moved_point(actual, link) + point, actual


def effect_of(name: str) -> Effect:
    """Return an effect of the library, for a name that a model file gives.

    Raises:
        DataError: GAP002 if no effect has this name.
    """
    if name not in EFFECTS:
        raise DataError("GAP002", EFFECTS.unknown(name))
    return EFFECTS.get(name)


def columns(samples: Samples, basis: Basis) -> FloatArray:
    """Return (n, 3, p) the motion of the point per unit of each parameter, to first order."""
    parts = []
    if basis.joint is not None:
        parts.append(samples.jacobian @ basis.joint)
    if basis.link is not None:
        parts.append(_link_columns(samples, basis.link))
    if basis.point is not None:
        parts.append(basis.point)
    return np.asarray(reduce(np.add, parts))


def _link_columns(samples: Samples, link: FloatArray) -> FloatArray:
    total = np.zeros((len(samples), 3, link.shape[3]))
    for k in range(7):
        part = link[:, k]
        if not bool(np.any(part)):
            continue
        R, origin = samples.frames[:, k, :3, :3], samples.frames[:, k, :3, 3]
        lever = skew(samples.point - origin)
        total += R @ part[:, 3:] - lever @ (R @ part[:, :3])
    return total


def _sum(
    samples: Samples, parts: list[tuple[Effect, State, Basis]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    turn = np.zeros((len(samples), 6))
    link = _zeros_link(samples)
    point = np.zeros((len(samples), 3))
    for _, state, basis in parts:
        theta = np.nan_to_num(state.theta, nan=0.0)
        if basis.joint is not None:
            turn += basis.joint @ theta
        if basis.link is not None:
            link += basis.link @ theta
        if basis.point is not None:
            point += basis.point @ theta
    return turn, link, point


def _zeros_link(samples: Samples) -> FloatArray:
    return np.zeros((len(samples), 7, 6))


def _moved_point(samples: Samples, link: FloatArray) -> FloatArray:
    """Return the point with a small motion put in beyond each frame, exactly."""
    if not bool(np.any(link)):
        return samples.point
    p = apply(inverse(samples.frames[:, 6]), samples.point)
    for k in range(6, -1, -1):
        R = rotation_from_vector(link[:, k, :3])
        p = np.einsum("nij,nj->ni", R, p) + link[:, k, 3:]
        T = samples.frames[:, k]
        p = apply(inverse(samples.frames[:, k - 1]) @ T if k else T, p)
    return p


def spread_of(
    spread: Mapping[str, FloatArray],
    samples: Samples,
    states: States,
    settings: Mapping[str, Setting] | None = None,
    again: Iterable[str] = (),
) -> FloatArray:
    """Return the 3D standard deviations (n,) [m] of points that wrong numbers leave open.

    Args:
        spread: by effect, as in a reach; what cannot act on these rows does not count, nor what is
            not the arm's and in no state.
        samples: rows at the commanded angles.
        states: of all effects that act.
        settings: of effects that are not in the states.
        again: effects that are fitted anew on these rows, and take in what they can.
    """
    actual = evaluate(samples, states)[1]

    def moving(name: str) -> tuple[FloatArray, FloatArray]:
        effect = effect_of(name)
        known = states[name].setting if name in states else (settings or {}).get(name)
        setting = effect.prepare(samples) if known is None else known
        sizes = np.array([p.typical for p in effect.parameters(samples.arm, setting)])
        return columns(actual, effect.basis(actual, setting)), sizes

    count = max((len(part) for part in spread.values()), default=0)
    moved = np.zeros((count, len(samples), 3))
    for name, part in spread.items():
        effect = effect_of(name)
        if not (effect.is_arms or name in states) or not all(map(samples.has, effect.needs)):
            continue
        X, sizes = moving(name)
        if X.shape[2] == part.shape[1]:
            moved += np.einsum("nap,dp->dna", X, part * sizes, optimize=True)
    flat = moved.reshape(count, 3 * len(samples))
    frames = [moving(name)[0] for name in again]
    if frames and count:
        A = np.concatenate(frames, axis=2).reshape(3 * len(samples), -1)
        flat = flat - (A @ np.linalg.lstsq(A, flat.T, rcond=None)[0]).T
    return np.asarray(np.sqrt(np.sum(flat.reshape(moved.shape) ** 2, axis=(0, 2))))


@dataclass(frozen=True, slots=True)
class RobotModel:
    """What the simulation knows of one robot: its cell and the effects of a model file."""

    arm: Arm
    states: States
    file: ModelFile | None = None

    @property
    def reach(self) -> Reach | None:
        """Where the model was measured, None where it does not say."""
        return self.file.reach if self.file else None

    @classmethod
    def of(
        cls,
        kinematics: Kinematics,
        cell: Cell,
        model: ModelFile | None = None,
        measured_point: bool = False,
        instrument: bool = False,
    ) -> RobotModel:
        """Return the model of a cell.

        Args:
            kinematics: of the cell's robot.
            cell: with its tool.
            model: effects to add; None for the nominal rigid arm.
            measured_point: answer for the point that the registration saw, not for the TCP.
            instrument: answer for what the campaign's instrument reads, not for the arm.

        Raises:
            DataError: GAP002 unknown effect, MOD004 to MOD006 wrong table.
        """
        registration = model.registration if model else None
        arm = arm_of(kinematics, cell, registration if measured_point else None)
        states = {}
        tables = model.effects if model else {}
        for name in (*tables, *(model.instrument if model and instrument else ())):
            states[name] = _effect_in(model, name).read(model, arm) if model else State(np.zeros(0))
        return cls(arm, states, model)

    def samples(
        self,
        q: FloatArray,
        wrench: FloatArray | None = None,
        conditions: Mapping[str, Any] | None = None,
    ) -> Samples:
        """Return rows (n, 6) [rad] with loads (n, 6) or (6,) and other logged columns."""
        if wrench is not None:
            wrench = np.broadcast_to(np.asarray(wrench, dtype=np.float64), np.shape(q))
        return make_samples(self.arm, q, wrench=wrench, **(conditions or {}))

    def nominal(self, q: FloatArray) -> FloatArray:
        """Return (n, 3) the point of the nominal rigid arm [m], robroot."""
        return self.samples(q).point

    def tool_point(
        self,
        q: FloatArray,
        wrench: FloatArray | None = None,
        conditions: Mapping[str, Any] | None = None,
    ) -> FloatArray:
        """Return (n, 3) the real tool point [m], axes of robroot.

        An effect whose columns are not given moves nothing; ``missing`` names it.
        """
        samples = self.samples(q, wrench, conditions)
        return tool_point(samples, self.usable(samples))

    def displacement(
        self,
        q: FloatArray,
        wrench: FloatArray | None = None,
        conditions: Mapping[str, Any] | None = None,
    ) -> FloatArray:
        """Return (n, 3) real minus nominal tool point [m], axes of robroot."""
        samples = self.samples(q, wrench, conditions)
        return tool_point(samples, self.usable(samples)) - samples.point

    def usable(self, samples: Samples) -> States:
        """Return the effects whose columns are there."""
        return {n: s for n, s in self.states.items() if n not in self.missing(samples)}

    def certain(
        self, samples: Samples, again: Iterable[str] = ()
    ) -> tuple[FloatArray | None, BoolArray | None]:
        """Return the radii (n,) [m] that hold the points with 95 %, and where the model reaches.

        Nothing where it does not say. It reaches nowhere where a column is missing that one of its
        effects needs.

        Args:
            samples: rows at the commanded angles.
            again: effects of the frames that are fitted anew on these rows.
        """
        if self.reach is None:
            return None, None
        spread = spread_of(self.reach.spread, samples, self.usable(samples), None, again)
        inside = self.reach.holds(samples.q, samples.wrench) & (not self.missing(samples))
        return self.reach.radius(samples.q, spread), inside

    def missing(self, samples: Samples) -> tuple[str, ...]:
        """Return the effects that need a column which was not logged."""
        return tuple(
            name
            for name in self.states
            if not all(samples.has(column) for column in effect_of(name).needs)
        )


def _effect_in(model: ModelFile, name: str) -> Effect:
    try:
        return effect_of(name)
    except DataError as problem:
        raise DataError(problem.code, problem.message, model.source(name)) from None


def stiffness_of(
    model: ModelFile, k_fallback: FloatArray | None = None, locate: Locate | None = None
) -> StiffnessField | None:
    """Return the joint stiffness of a model, None where it knows none.

    Where two effects give one, that counts which refines the other.

    Args:
        model: with tables of effects.
        k_fallback: (6,) [N*m/rad] for joints that the data could not see; None: rigid.
        locate: joint angles to tool points, for a field over space.

    Raises:
        DataError: MOD004 to MOD006 for wrong tables, with the line.
    """
    known = [effect for name, effect in EFFECTS if name in model.effects]
    for effect in sorted(known, key=lambda e: -len(e.refines)):
        field = effect.stiffness(model, locate)
        if field is not None:
            return field.with_fallback(k_fallback)
    return None


def stiffness_tables(field: StiffnessField, c_mean: FloatArray) -> dict[str, Table]:
    """Return the effects' tables that hold an identified stiffness.

    Args:
        field: the stiffness.
        c_mean: (6,) its constant part, NaN for a joint not seen [rad/(N*m)].
    """
    tables = {name: effect.stiffness_table(field, c_mean) for name, effect in EFFECTS}
    return {name: table for name, table in tables.items() if table is not None}
