"""Gears that do not turn evenly: an error with two or more periods per turn of a joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, register
from postproc.model import ModelFile
from postproc.units import DEG


@register
class TransmissionError(Effect):
    """Sine waves in a joint's own angle; which joints and how many periods the data must say.

    One period per turn is left out: it cannot be told from gravity, springs and offsets.
    """

    name = "transmission_error"
    title = "gear error, periodic in a joint's angle"
    source = "J (A cos n q + B sin n q), n >= 2 periods per turn"
    action = "compensate with model.toml; inspect the gear of the named joint"
    conditions = ("joint angle",)
    periodic = True
    may_be_several = True

    def prepare(self, samples: Samples) -> Setting:
        """Return two and three periods of each joint; a search may choose others."""
        del samples
        return {"waves": tuple((joint, n) for joint in range(1, 7) for n in (2.0, 3.0))}

    def joined(self, settings: Sequence[Setting]) -> Setting:
        """Return all waves together."""
        return {"waves": tuple(wave for setting in settings for wave in setting["waves"])}

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return two amplitudes [rad] for each wave."""
        del arm
        return tuple(
            Parameter(
                f"joint_{joint}_{n:g}_{part}", 1e-4, joint=int(joint), family=f"{joint}:{n:g}"
            )
            for joint, n in setting["waves"]
            for part in ("cos", "sin")
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn a joint by a wave of its own angle."""
        waves = setting["waves"]
        joint = np.zeros((len(samples), 6, 2 * len(waves)))
        for index, (number, n) in enumerate(waves):
            phase = n * samples.q[:, int(number) - 1]
            joint[:, int(number) - 1, 2 * index] = np.cos(phase)
            joint[:, int(number) - 1, 2 * index + 1] = np.sin(phase)
        return Basis(joint=joint)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return joints, periods per turn and amplitudes of the waves."""
        del arm
        waves = state.setting["waves"]
        amplitudes = np.nan_to_num(state.theta).reshape(-1, 2) / DEG
        return {
            "joint": [int(joint) for joint, _ in waves],
            "periods_per_turn": [float(n) for _, n in waves],
            "cosine_deg": amplitudes[:, 0].tolist(),
            "sine_deg": amplitudes[:, 1].tolist(),
        }

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the waves of a table."""
        del arm
        model.require_known(self.name, ["joint", "periods_per_turn", "cosine_deg", "sine_deg"])
        joint = np.asarray(model.values(self.name, "joint", (None,)))
        shape = (len(joint),)
        periods = np.asarray(model.values(self.name, "periods_per_turn", shape))
        cosine = np.asarray(model.values(self.name, "cosine_deg", shape))
        sine = np.asarray(model.values(self.name, "sine_deg", shape))
        waves = tuple((int(j), float(n)) for j, n in zip(joint, periods, strict=True))
        return State(np.column_stack([cosine, sine]).ravel(), {"waves": waves})
