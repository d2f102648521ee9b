"""Each tool of a campaign has a tool point of its own that is off."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import (
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    State,
    point_moved,
    register,
)
from postproc.measurement import labels_of
from postproc.model import ModelFile, entry


class Mounts(Effect):
    """What rows of one label of a column have in common: a small motion, off by the label."""

    kind = Kind.MEASUREMENT
    moves: ClassVar[tuple[tuple[str, str, float], ...]]
    """What moves, the unit of its key in a file, and the usual size [m, rad]."""

    def prepare(self, samples: Samples) -> Setting:
        """Return the labels in the rows."""
        return {"labels": sorted(set(labels_of(samples.column(self.needs[0]))))}

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return three numbers of each motion for each label."""
        del arm
        return tuple(
            Parameter(f"{label}_{what}_{axis}", size, family=what)
            for label in setting["labels"]
            for what, _, size in self.moves
            for axis in "xyz"
        )

    def here(self, samples: Samples, setting: Setting) -> FloatArray:
        """Return (n, k) 1 where a row has a label."""
        words = np.array(labels_of(samples.column(self.needs[0])))
        return np.asarray(words[:, None] == np.array(setting["labels"]), dtype=np.float64)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the labels and what is off with each."""
        del arm
        parts = np.nan_to_num(state.theta).reshape(-1, len(self.moves), 3)
        keys = [f"{what}_{unit}" for what, unit, _ in self.moves]
        table = {key: entry(key, parts[:, k]) for k, key in enumerate(keys)}
        return {self.needs[0]: list(state.setting["labels"]), **table}

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return what is off with each label of a table."""
        del arm
        keys = [f"{what}_{unit}" for what, unit, _ in self.moves]
        model.require_known(self.name, [self.needs[0], *keys])
        labels = [str(label) for label in model.table(self.name).get(self.needs[0], ())]
        parts = [np.asarray(model.values(self.name, key, (len(labels), 3))) for key in keys]
        return State(np.stack(parts, axis=1).ravel(), {"labels": labels})


@register
class ToolFrames(Mounts):
    """Shift of the measured point in the flange for each tool."""

    name = "tool_frames"
    title = "the tool points of several tools are off, each in its own way"
    source = "R c of each tool, three axes of the flange"
    action = "measure each tool again (XYZ 4-point) and correct its TOOL_DATA"
    needs = ("tool_no",)
    conditions = ("tool_no", "orientation")
    moves = (("shift", "mm", 3e-4),)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move the point beyond joint 6 of the rows of a tool."""
        return Basis(link=point_moved(samples, self.here(samples, setting)))
