"""The fixture gives way under load, by the place (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import (
    SYMMETRIC,
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    centre_and_extent,
    from_centre,
    register,
    symmetric,
)


@register
class FixtureGive(Effect):
    """A Cartesian compliance of the workpiece that changes with the place of the contact.

    The part that does not change stands in the resemblance of a tool or fixture that gives way.
    """

    name = "fixture_give"
    title = "behaves like a workpiece or fixture that gives way, depending on the place"
    source = "displacement C(p) F, C linear in the place"
    action = "put an indicator between workpiece and floor at several places"
    kind = Kind.ALTERNATIVE
    needs = ("wrench",)
    conditions = ("load", "position")
    parameter_list = tuple(
        Parameter(f"give_{i}{j}_{way}", 0.1)
        for way in ("mean", "x", "y", "z")
        for i, j in SYMMETRIC
    )
    """A compliance and its change along x, y, z, relative to joint 2's."""

    def prepare(self, samples: Samples) -> Setting:
        """Return centre [m] and extent [m] of the places."""
        return centre_and_extent(samples.point)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Shift the point."""
        unit = float(samples.arm.reference.c_joint[1])
        force = samples.column("wrench")[:, :3] * unit
        place = np.tanh(from_centre(samples.point, setting))
        still = symmetric(force)
        return Basis(
            point=np.concatenate([still, *(way[:, None, None] * still for way in place.T)], axis=2)
        )
