"""What an effect is: one cause of a gap, its parameters, and how they move the tool point.

An effect is one file in ``postproc/gap/effects``. It names the columns it needs, its parameters
with a typical size (the standard deviation of a Gaussian prior) and bounds, and a ``basis``: what
one unit of each parameter does to the joints, to the links or to the measured point. The basis is
linear in the parameters; what is nonlinear (exact forward kinematics, the equilibrium of a load
that moves the arm that carries it) is done once for all effects by ``RobotModel``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.model import ModelFile, entry
from postproc.registry import Registry

if TYPE_CHECKING:
    from postproc.gap.data import Arm, Samples

Setting = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect, SI units.

    ``typical``: what is usual in practice, the standard deviation of the prior around zero.
    ``joint``: 1..6 where the number belongs to one joint, else 0. ``largest``: beyond it the
    number is no longer physical for this cause.
    """

    name: str
    typical: float
    lower: float = -np.inf
    upper: float = np.inf
    joint: int = 0

    @property
    def largest(self) -> float:
        """Return the size beyond which the cause is not believed."""
        return 20.0 * self.typical


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
    kind: ClassVar[str] = "machine"
    """``machine``, ``measurement`` (how it was measured), or ``suspect``: a resemblance that is
    tested against the library but never named as the cause."""
    conditions: ClassVar[tuple[str, ...]] = ()
    """Conditions that it makes the gap depend on, as in ``where.conditions``."""
    equilibrium: ClassVar[bool] = False
    """The basis depends on the load at the pose that the arm really takes."""
    layout: ClassVar[tuple[tuple[str, int], ...]] = ()
    """Keys of the model file with the count of parameters behind each (1: a plain number)."""

    @abstractmethod
    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the parameters in the order of the basis' last axis."""

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

    def objection(self, theta: FloatArray, deviation: FloatArray, arm: Arm) -> str:
        """Return why fitted numbers (p,) are not physical for this cause, empty if they are.

        Args:
            theta: fitted numbers.
            deviation: their standard deviations.
            arm: the arm they belong to.
        """
        del theta, deviation, arm
        return ""

    def placebo(self, samples: Samples, rng: np.random.Generator) -> Samples:
        """Return the same rows with the meaning of the needed columns destroyed.

        By default the needed columns are shuffled among the rows; an effect of the pose alone
        has nothing to shuffle but the pose itself.
        """
        order = rng.permutation(len(samples))
        if not self.needs:
            return samples.at(samples.q[order])
        return samples.shuffled(self.needs, order)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the table of the model file, file units; NaN where the data saw nothing."""
        del arm
        table: dict[str, Any] = {}
        start = 0
        for key, count in self.layout:
            values = state.theta[start : start + count]
            table[key] = entry(key, values if count > 1 else values[0])
            start += count
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
        known = [key for key, _ in self.layout]
        model.require_known(self.name, [*known, "unobservable_joints"])
        parts = []
        for index, (key, count) in enumerate(self.layout):
            shape: tuple[int, ...] = (count,) if count > 1 else ()
            values = model.values(self.name, key, shape, optional=index > 0)
            parts.append(np.zeros(count) if values is None else np.atleast_1d(values))
        return State(np.concatenate(parts))


EFFECTS: Registry[Effect] = Registry("effects", "postproc.gap.effects", Effect)
"""All effects by name."""


def register(cls: type[Effect]) -> type[Effect]:
    """Add an effect class of the library to the registry (decorator).

    Raises:
        PluginError: if the name is taken.
    """
    EFFECTS.register(cls.name)(cls())
    return cls


SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Row and column of the six numbers of a symmetric matrix."""


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
