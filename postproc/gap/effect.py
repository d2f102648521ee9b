"""What an effect is: one cause of a gap, its parameters, and how they move the tool point.

An effect is one file in ``postproc/gap/effects``, named as the effect. It names the columns it
needs, its parameters with a typical size (the standard deviation of a Gaussian prior) and bounds,
and a ``basis``: what one unit of each parameter does to the joints, to the links or to the measured
point. The basis is linear in the parameters; what is nonlinear (exact forward kinematics, the
equilibrium of a load that moves the arm that carries it) is done once for all effects by
``RobotModel``. All that others must know of an effect it declares itself: what it refines, what it
is mistaken for, what absorbs it, what it says of the joint stiffness. No other file has its name.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.model import ModelFile, Registration, entry
from postproc.records import dataclass
from postproc.registry import Registry
from postproc.stiffness import Locate, StiffnessField

Setting = Mapping[str, Any]
Table = Mapping[str, Any]
"""An effect's table of a model file: its own keys, values in the unit that ends each key."""
MOTION_COLUMNS = ("direction", "qd")
"""Columns that only the motion of a program tells: from which side, how fast."""
PROGRAM_COLUMNS = (*MOTION_COLUMNS, "wrench")
"""Columns that are known of a program before it runs."""


class Kind(StrEnum):
    """What an effect is of, and with it when it is named as a cause."""

    MACHINE = "machine"
    MEASUREMENT = "measurement"
    """What measured, held or carried the arm: told in readings, and no part of the arm's model."""
    REGISTRATION = "registration"
    """Where robot and measured point stand: not named where a registration is fitted."""
    ALTERNATIVE = "alternative"
    """A resemblance: tested against the others, never named as the cause."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect, SI units.

    ``typical``: what is usual in practice, the standard deviation of the prior around zero.
    ``joint``: 1..6 where the number belongs to one joint, else 0. ``family``: numbers of one family
    are large or small together.
    """

    name: str
    typical: float
    lower: float = -np.inf
    upper: float = np.inf
    joint: int = 0
    family: str = ""


@dataclass(frozen=True, slots=True)
class Basis:
    """What one unit of each of p parameters does, for n rows; a part that is not moved is None.

    joint: (n, 6, p) added to the joint angles [rad per unit]. link: (n, 7, 6, p) small motion of
    everything beyond frame k (0 = robot root, k = after joint k), axes and origin of frame k,
    rotation vector [rad] above translation [m]. point: (n, 3, p) added to the measured point [m],
    axes of robroot.
    """

    joint: FloatArray | None = None
    link: FloatArray | None = None
    point: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class State:
    """An effect with numbers: parameters (p,) in SI (NaN: not seen) and its setting."""

    theta: FloatArray
    setting: Setting = field(default_factory=dict)


class Effect(ABC):
    """One cause of a gap between a robot and its model."""

    name: ClassVar[str]
    title: ClassVar[str]
    """Plain words for a person at the machine."""
    source: ClassVar[str]
    action: ClassVar[str]
    """What to do about it on the shop floor."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Columns of the measurement without which it cannot be tested."""
    kind: ClassVar[Kind] = Kind.MACHINE
    conditions: ClassVar[tuple[str, ...]] = ()
    """Conditions that it makes the gap depend on, as in ``where.conditions``."""
    equilibrium: ClassVar[bool] = False
    """The basis depends on the load at the pose that the arm really takes."""
    layout: ClassVar[tuple[tuple[str, int | tuple[int, ...]], ...]] = ()
    """Keys of the model file with count (1: a plain number) or shape of the parameters behind."""
    setting_keys: ClassVar[Mapping[str, str]] = {}
    """Numbers of the setting to their keys of the model file."""
    parameter_list: ClassVar[tuple[Parameter, ...]] = ()
    """The parameters, where they depend neither on the arm nor on the setting."""
    geometric: ClassVar[bool] = False
    """It moves the tool as a wrong geometry of arm or frames does."""
    of_several: ClassVar[bool] = False
    """Only of campaigns with several stations or reflectors, or unknown ends of readings."""
    periodic: ClassVar[bool] = False
    """Waves of a joint's angle, whose joints and orders are sought in the rows."""
    on_demand: ClassVar[bool] = False
    """It has so many numbers that it is tried only where what is left calls for it."""
    may_be_several: ClassVar[bool] = False
    """Several of its variants may be there at once, and are one effect with a joined setting."""
    is_common: ClassVar[bool] = False
    """Every arm has it, more or less."""
    is_rare: ClassVar[bool] = False
    """Seldom the cause, and like many others where the joints turn little: it is named only where
    common causes do not come near."""
    has_tool_weight: ClassVar[bool] = False
    """It is fitted to the arm with its tool on: the tool's weight is in it."""
    refines: ClassVar[tuple[str, ...]] = ()
    """Effects that it describes more closely: it comes after them, for alone it would have to be
    them too."""

    @property
    def is_arms(self) -> bool:
        """Whether it is of the arm and its frames, not of what measured or held it."""
        return self.kind is not Kind.MEASUREMENT

    @property
    def is_alternative(self) -> bool:
        """Whether it is only a resemblance, never a named cause."""
        return self.kind == Kind.ALTERNATIVE

    @property
    def follows_motion(self) -> bool:
        """Whether it depends on how the joints move: from which side, how fast."""
        return not set(self.needs).isdisjoint(MOTION_COLUMNS)

    @property
    def unknown_to_programs(self) -> tuple[str, ...]:
        """Columns it needs that no program knows; with any it cannot be compensated."""
        return tuple(sorted(set(self.needs) - set(PROGRAM_COLUMNS)))

    def drawn(self, normal: FloatArray) -> FloatArray:
        """Return numbers (d, p) in typical sizes as arms have them, from independent normal ones.

        Those of the prior, where nothing ties the numbers of one arm to each other.
        """
        return normal

    def lost_motion(self, theta: FloatArray) -> FloatArray:
        """Return how far (6,) [rad] each joint turns back before it rests on the other side.

        Args:
            theta: numbers (p,) of the effect.
        """
        del theta
        return np.zeros(6)

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the parameters in the order of the basis' last axis."""
        del arm, setting
        return self.parameter_list

    @abstractmethod
    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Return what one unit of each parameter does.

        Raises:
            DataError: GAP001 if a needed column was not logged.
        """

    def prepare(self, samples: Samples) -> Setting:
        """Return what the effect fixes once from the data it is fitted to (reference values)."""
        del samples
        return {}

    def variants(self, setting: Setting) -> dict[str, Setting]:
        """Return what a search may choose from, one of them, by key.

        Args:
            setting: as ``prepare`` gives it.
        """
        return {self.name: setting}

    def joined(self, settings: Sequence[Setting]) -> Setting:
        """Return the setting of several variants together, their numbers one after the other."""
        raise TypeError(f"{self.name} is one variant at a time")

    def correlation_root(self, setting: Setting) -> FloatArray | None:
        """Return the root (p, p) of the prior's correlation, None where numbers are independent."""
        del setting
        return None

    def objection(self, theta: FloatArray, deviation: FloatArray, arm: Arm) -> str:
        """Return why fitted numbers (p,) are not physical for this cause, empty if they are.

        Args:
            theta: fitted numbers.
            deviation: their standard deviations.
            arm: the arm they belong to.
        """
        del theta, deviation, arm
        return ""

    def is_unusual(self, theta: FloatArray, deviation: FloatArray) -> bool:
        """Return whether fitted numbers (p,) are possible for this cause, and seldom.

        Args:
            theta: fitted numbers.
            deviation: their standard deviations.
        """
        del theta, deviation
        return False

    def ends(self, theta: FloatArray, width: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both ends (p,) of the intervals of fitted numbers with half widths (p,)."""
        return theta - width, theta + width

    def is_fixed(self, setting: Setting) -> bool:
        """Return whether a setting, as a model file gave it, leaves nothing to fit."""
        del setting
        return False

    def registered(self, registration: Registration, theta: FloatArray) -> Registration:
        """Return a registration that takes fitted numbers (p,) of this effect in."""
        del theta
        return registration

    def stiffness(self, model: ModelFile, locate: Locate | None) -> StiffnessField | None:
        """Return the whole joint stiffness that the effect's table of a model gives, if any.

        Args:
            model: with a table of this effect.
            locate: joint angles to tool points, for a stiffness over space.

        Raises:
            DataError: MOD004 to MOD006 for a wrong table, with the line.
        """
        del model, locate
        return None

    def stiffness_table(self, field: StiffnessField, c_mean: FloatArray) -> Table | None:
        """Return the table that holds an identified stiffness, if this effect can.

        Args:
            field: the stiffness.
            c_mean: (6,) its constant part, NaN for a joint not seen [rad/(N*m)].
        """
        del field, c_mean
        return None

    def completed(self, table: Table, joint_stiffness: FloatArray | None) -> Table:
        """Return a table with what the data could not see taken from the cell, if it can be.

        Args:
            table: as in a model file.
            joint_stiffness: (6,) of the cell [N*m/rad].
        """
        del joint_stiffness
        return table

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the table of the model file, file units; NaN where the data saw nothing."""
        del arm
        table = {key: entry(key, state.setting[name]) for name, key in self.setting_keys.items()}
        start = 0
        for key, shape in self._shapes():
            end = start + math.prod(shape)
            table[key] = entry(key, state.theta[start:end].reshape(shape))
            start = end
        unseen = unseen_joints(state.theta) if self.layout and self.layout[0][1] == 6 else []
        if unseen:
            table["unobservable_joints"] = unseen
        return table

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the state that a model file's table gives.

        Raises:
            DataError: MOD004, MOD005, MOD006 from the table.
        """
        del arm
        known = [*self.setting_keys.values(), *(key for key, _ in self.layout)]
        model.require_known(self.name, [*known, "unobservable_joints"])
        numbers = ((n, model.values(self.name, key)) for n, key in self.setting_keys.items())
        setting = {name: float(np.asarray(value)) for name, value in numbers}
        parts = []
        for index, (key, shape) in enumerate(self._shapes()):
            values = model.values(self.name, key, shape, optional=index > 0)
            parts.append(np.zeros(math.prod(shape)) if values is None else np.ravel(values))
        return State(np.concatenate(parts), setting)

    def _shapes(self) -> Iterator[tuple[str, tuple[int, ...]]]:
        """Yield the keys of the layout with the shapes of their numbers."""
        for key, count in self.layout:
            yield key, ((count,) if count > 1 else ()) if isinstance(count, int) else count


EFFECTS: Registry[Effect] = Registry("effects", "postproc.gap.effects", Effect)
"""All effects by name."""


def register(cls: type[Effect]) -> type[Effect]:
    """Add an effect class of the library to the registry (decorator).

    Raises:
        PluginError: if the name is taken.
    """
    EFFECTS.register(cls.name)(cls())
    return cls


def registration_effects() -> tuple[str, ...]:
    """Return the names of what a registration fits; with one they are never named."""
    return tuple(name for name, effect in EFFECTS if effect.kind == Kind.REGISTRATION)


def periodic_effect() -> Effect:
    """Return the effect whose waves are sought in the rows."""
    return next(effect for _, effect in EFFECTS if effect.periodic)


SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Row and column of the six numbers of a symmetric matrix."""


def symmetric(vector: FloatArray) -> FloatArray:
    """Return (n, 3, 6): unit symmetric matrices, in the order of ``SYMMETRIC``, times (n, 3)."""
    out = np.zeros((len(vector), 3, len(SYMMETRIC)))
    for column, (i, j) in enumerate(SYMMETRIC):
        out[:, i, column] = vector[:, j]
        out[:, j, column] = vector[:, i]
    return out


def base_moved(forms: FloatArray) -> FloatArray:
    """Return (n, 7, 6, 6 f) a shift and a turn of frame 0 in proportion to each form (n, f)."""
    both = np.eye(6)[[3, 4, 5, 0, 1, 2]]
    link = np.zeros((len(forms), 7, 6, 6 * forms.shape[1]))
    link[:, 0] = np.einsum("nf,ij->nifj", forms, both).reshape(len(forms), 6, -1)
    return link


def point_moved(samples: Samples, forms: FloatArray) -> FloatArray:
    """Return (n, 7, 6, 3 f) a shift, in the flange, of the point beyond joint 6, likewise."""
    _, _, R_6_flange = samples.arm.link_constants()
    link = np.zeros((len(forms), 7, 6, 3 * forms.shape[1]))
    link[:, 6, 3:] = np.einsum("nf,ij->nifj", forms, R_6_flange).reshape(len(forms), 3, -1)
    return link


def centre_and_extent(points: FloatArray) -> Setting:
    """Return the centre [m] and the usual distance per axis [m] of places (n, 3)."""
    centre = np.mean(points, axis=0)
    extent = float(np.sqrt(np.mean((points - centre) ** 2))) + 1e-6
    return {"centre": centre.tolist(), "extent": extent}


def from_centre(points: FloatArray, setting: Setting) -> FloatArray:
    """Return places (n, 3) about the centre, in extents."""
    return np.asarray((points - np.asarray(setting["centre"])) / float(setting["extent"]))


def unseen_joints(theta: FloatArray) -> list[int]:
    """Return the joints (1..6) whose number is NaN among the first six."""
    return [int(i) + 1 for i in np.flatnonzero(np.isnan(theta[:6]))]


def per_joint(typical: FloatArray | float, lower: float = -np.inf) -> tuple[Parameter, ...]:
    """Return six parameters, one a joint."""
    sizes = np.broadcast_to(np.asarray(typical, dtype=np.float64), (6,))
    return tuple(
        Parameter(f"joint_{i + 1}", float(size), lower, np.inf, i + 1)
        for i, size in enumerate(sizes)
    )


def diagonal(values: FloatArray) -> FloatArray:
    """Return (n, 6, 6): parameter i moves joint i by ``values[:, i]``."""
    out = np.zeros((*values.shape, 6))
    index = np.arange(6)
    out[:, index, index] = values
    return out
