"""Link lengths and the directions of the joint axes differ from the drawing."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register
from postproc.geometry import across


@register
class LinkGeometry(Effect):
    """Axes 2 to 6 each shifted and tilted against the axis before, four numbers an axis.

    Shift and tilt along the axis itself are left out: the first changes nothing or belongs to a
    neighbour, the second is a joint offset. With the base frame this spans every rigid geometry,
    so it is a superset of joint offsets: parsimony must decide.
    """

    name = "link_geometry"
    title = "link lengths or axis directions differ from the drawing"
    source = "product of exponentials, line geometry of the joint axes (4 numbers an axis)"
    action = "have the arm calibrated; use model.toml for compensation meanwhile"
    conditions = ("pose",)
    geometric = True
    is_common = True
    layout = (("axis_shift_mm", 10), ("axis_tilt_deg", 10))
    parameter_list = tuple(
        Parameter(f"axis_{axis}_{way}_{kind}", size, family=kind)
        for kind, size in (("shift", 3e-4), ("tilt", 2e-4))
        for axis in range(2, 7)
        for way in "ab"
    )
    """Ten shifts [m], then ten tilts [rad], two for each of the axes 2 to 6."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame k about the origin of frame k+1, across the axis of joint k+1."""
        del setting
        origins, axes, _ = samples.arm.link_constants()
        link = np.zeros((7, 6, 20))
        for k in range(1, 6):
            for way, side in enumerate(across(axes[k])):
                column = 2 * (k - 1) + way
                link[k, 3:, column] = side
                link[k, :3, 10 + column] = side
                link[k, 3:, 10 + column] = np.cross(origins[k], side)
        return Basis(link=np.broadcast_to(link, (len(samples), 7, 6, 20)))
