"""An effect: the tracker rides along X on a rail whose sections bow, and reads heights that wave.

What an effect owes: plain words for the shop floor, parameters in SI with a typical size, and what
one unit of each does to the tool point. Everything else (fit, selection, intervals, the model file)
follows; ``postproc.testing.check_effect`` holds it to that.
"""

from __future__ import annotations

import numpy as np

from postproc.gap import Basis, Effect, Kind, Parameter, Samples, Setting

SECTION = 0.5
"""Length of a section of the rail [m]."""


class RailWave(Effect):
    """Heights wave along X with the sections of the rail."""

    name = "rail_wave"
    title = "the tracker's rail is not straight"
    source = "dz = a sin(2 pi x / L) + b cos(2 pi x / L), L the length of a section"
    action = "level the sections of the rail, or measure from one place"
    kind = Kind.MEASUREMENT
    conditions = ("position",)
    layout = (("sine_mm", 1), ("cosine_mm", 1))
    parameter_list = (Parameter("sine", 1e-4), Parameter("cosine", 1e-4))
    """The two amplitudes [m]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Lift each point by a metre of the wave per unit."""
        del setting
        phase = 2.0 * np.pi * samples.point[:, 0] / SECTION
        point = np.zeros((len(samples), 3, 2))
        point[:, 2] = np.column_stack([np.sin(phase), np.cos(phase)])
        return Basis(point=point)


RAIL_WAVE = RailWave()
