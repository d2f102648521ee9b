"""The columns of one effect: what one usual size of each of its numbers moves the points by."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, Parameter, Setting
from postproc.gap.robot_model import columns
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Block:
    """Columns of one effect, (n, 3, p) in metres per typical size."""

    effect: Effect
    setting: Setting
    parameters: tuple[Parameter, ...]
    X: FloatArray

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def block_of(effect: Effect, samples: Samples, setting: Setting) -> Block:
    """Return the columns of an effect at these samples."""
    parameters = effect.parameters(samples.arm, setting)
    typical = np.array([p.typical for p in parameters])
    X = columns(samples, effect.basis(samples, setting)) * typical
    return Block(effect, setting, parameters, X)
