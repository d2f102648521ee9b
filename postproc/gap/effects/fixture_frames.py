"""Each fixture of a campaign stands a little off."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Setting, register
from postproc.gap.effects.tool_frames import Mounts


@register
class FixtureFrames(Mounts):
    """Shift and turn of what is measured at each fixture."""

    name = "fixture_frames"
    title = "several fixtures stand off, each in its own way"
    source = "t + w x p of each fixture"
    action = "measure each fixture again and correct its BASE_DATA"
    needs = ("fixture",)
    conditions = ("fixture", "position")
    moves = (("shift", "mm", 3e-4), ("turn", "deg", 1e-4))

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0 of the rows of a fixture."""
        here = self.here(samples, setting)
        link = np.zeros((len(samples), 7, 6, 6 * here.shape[1]))
        for k in range(here.shape[1]):
            for axis in range(3):
                link[:, 0, 3 + axis, 6 * k + axis] = here[:, k]
                link[:, 0, axis, 6 * k + 3 + axis] = here[:, k]
        return Basis(link=link)
