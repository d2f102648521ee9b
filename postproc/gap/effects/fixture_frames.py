"""Each fixture of a campaign stands a little off."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Setting, base_moved, register
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
        return Basis(link=base_moved(self.here(samples, setting)))
