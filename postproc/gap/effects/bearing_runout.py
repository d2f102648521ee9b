"""A main bearing that runs out: its axis moves once per turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from postproc.errors import DataError
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, register
from postproc.model import ModelFile

JOINTS = (1, 2, 3)
"""The joints with a main bearing; those of the wrist are small."""


@register
class BearingRunout(Effect):
    """What one main axis carries is shifted once per turn, as seen from the link before it.

    A wave of the axis' own angle that moves the bearing and turns nothing: no zero offset, spring
    or gear error does that over a wide range of the axis. Over a narrow one much does.
    """

    name = "bearing_runout"
    title = "a main bearing runs out: its axis shifts once per turn"
    source = "shift A cos q + B sin q in axes of the link before the joint"
    action = "put an indicator on the bearing of the named axis and turn it"
    conditions = ("joint angle",)
    geometric = True
    is_rare = True
    layout = (("cosine_mm", 3), ("sine_mm", 3))
    setting_keys: ClassVar[Mapping[str, str]] = {"joint": "joint"}

    def prepare(self, samples: Samples) -> Setting:
        """Return the bearing of axis 1; a search may choose another."""
        del samples
        return {"joint": JOINTS[0]}

    def variants(self, setting: Setting) -> dict[str, Setting]:
        """Return each main bearing."""
        del setting
        return {f"{self.name}:{joint}": {"joint": joint} for joint in JOINTS}

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the amplitudes of the shift [m]: those of the cosine, then those of the sine."""
        del arm
        joint = int(setting["joint"])
        return tuple(
            Parameter(f"joint_{joint}_{axis}_{part}", 1e-4, joint=joint)
            for part in ("cos", "sin")
            for axis in "xyz"
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move the frame before the joint along its axes."""
        joint = int(setting["joint"])
        q = samples.q[:, joint - 1]
        link = np.zeros((len(samples), 7, 6, 6))
        for column, wave in ((0, np.cos(q)), (3, np.sin(q))):
            for axis in range(3):
                link[:, joint - 1, 3 + axis, column + axis] = wave
        return Basis(link=link)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the axis and the amplitudes of the shift."""
        return super().write(state, arm) | {"joint": int(state.setting["joint"])}

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the shift of a table.

        Raises:
            DataError: MOD006 for an axis without a main bearing.
        """
        state = super().read(model, arm)
        if state.setting["joint"] not in JOINTS:
            raise DataError(
                "MOD006",
                f"effects.{self.name}.joint: expected 1, 2 or 3",
                model.source(self.name, "joint"),
            )
        return state
