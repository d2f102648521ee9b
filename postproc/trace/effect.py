"""What every effect along the path is: one class in one file, under one contract.

An effect is a displacement of joints or of the tool point as a function of the set-point, with
parameters. It tells its value and how the value changes with each parameter; fitting, evidence and
proof are the same for all, in ``fit`` and ``evidence``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.model import ModelFile
from postproc.records import dataclass
from postproc.registry import Registry
from postproc.trace.scene import Piece, Stage

PROGRAM, JOINTS, LINK, TOOL, WHOLE = "program", "joints", "link", "tool", "whole"
"""Program to command, command to motor, motor to link, motor to tool; command to tool where
no motor was recorded."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Value (m, n) of an effect at a stage, and its change with each parameter."""

    value: FloatArray
    pieces: list[Piece]


class PathEffect(ABC):
    """One effect; ``theta`` (p,) are its parameters in SI, 0 where the effect is absent.

    Args:
        name: in documents and model files; title, action: in words.
        stages: where it enters.
        rivals: effects that say the same in other words: one of them at most.
        keys: keys of its table in a model file.
        is_cause: it can be named; else it only stands against those that can.
        is_kept: a model file gives it back.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    action: ClassVar[str]
    stages: ClassVar[tuple[str, ...]]
    rivals: ClassVar[tuple[str, ...]] = ()
    keys: ClassVar[tuple[str, ...]]
    is_cause: ClassVar[bool] = True
    is_kept: ClassVar[bool] = True

    @abstractmethod
    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Return parameters to begin with, None where the stage cannot show the effect.

        Args:
            stage: where.
            rest: (m, n) what is to be explained.
            sigma: (m,) of its noise.
        """

    @abstractmethod
    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Return the value, with ``tangent`` its change with each parameter as well."""

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return the usual sizes (p,) of the parameters; inf: anything is as likely."""
        return np.full(len(theta), np.inf)

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return the parameters after a step of the fit."""
        return np.asarray(theta + step)

    def joined(self, theta: FloatArray, more: FloatArray) -> FloatArray:
        """Return the parameters (p,) of two parts of the effect as one."""
        return theta + more

    def lasting(self, theta: FloatArray) -> FloatArray:
        """Return the parameters (p,) of what stays until a joint moves otherwise."""
        return theta

    def count(self, theta: FloatArray) -> int:
        """Return how many free parameters these are."""
        return len(theta)

    def late(self, theta: FloatArray) -> float:
        """Return how late [s] the tool point is stamped."""
        del theta
        return 0.0

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return the parameters by the keys of the file, None for what the rows cannot tell."""
        del stage, theta, deviation
        return {}

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the parameters of a table of a model file, None for one of another kind."""
        del model, table
        return None


PATH_EFFECTS: Registry[PathEffect] = Registry("path_effects", "postproc.trace.effects", PathEffect)


def register(kind: type[PathEffect]) -> type[PathEffect]:
    """Add an effect class to the registry (decorator)."""
    PATH_EFFECTS.register(kind.name)(kind())
    return kind


def known_effects(model: ModelFile) -> dict[str, FloatArray]:
    """Return the parameters of the effects that a model file has for paths."""
    known: dict[str, FloatArray] = {}
    for name, table in model.effects.items():
        if name in PATH_EFFECTS:
            theta = PATH_EFFECTS.get(name).read(model, table)
            if theta is not None:
                known[name] = theta
    return known


def moving(stage: Stage, least: float) -> BoolArray:
    """Return which joints (6,) are faster than ``least`` [rad/s] in a hundredth of the rows."""
    return np.asarray(np.quantile(np.abs(stage.scene.speed), 0.99, axis=0) > least)


def seen(values: FloatArray, unit: float, known: BoolArray | bool = True) -> list[Any]:
    """Return values in the unit of the file, None where they are not known or not finite."""
    told = np.isfinite(values) & known
    return [
        float(value) if is_told else None
        for value, is_told in zip(np.round(values / unit, 6), told, strict=True)
    ]
