"""The reflector moves in its mount while it is measured."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Setting, point_moved, register
from postproc.gap.effects.tracker_creep import Creep


@register
class ReflectorCreep(Creep):
    """Shift of the measured point in the flange with time; the loads stay where they act."""

    name = "reflector_creep"
    title = "the reflector creeps in its mount"
    source = "R (t0 + t1 time), three axes of the flange"
    action = "glue or screw the nest; measure one pose again every 20 to 50 poses"
    conditions = ("time", "orientation")
    layout = (("line_mm", 3), ("curve_mm", 3))
    moves = (("shift", 1e-4),)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move the point beyond joint 6 in the course of time."""
        return Basis(link=point_moved(samples, self.course(samples, setting)))
