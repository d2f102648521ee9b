"""Whether the tool stays on the axis of a hole, and along it, on its way in and out."""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.errors import RunKind
from postproc.geometry import angle_between
from postproc.units import DEG, MM
from postproc.verification.cam.feeds import AT_MOST
from postproc.verification.cam.matching import Wanted
from postproc.verification.cam.real import RealPaths
from postproc.verification.report import Result

ON_TOP = 1e-5
"""So near [m] to the height where the feed starts a tool is at it."""


def check_strokes(
    result: Result,
    real: RealPaths,
    wanted: Wanted,
    on_axis: AnyIntArray,
    limits: tuple[float, float],
    shift: float,
) -> None:
    """Check both ends of every motion along the axis of a hole that is not all above it.

    A motion that only begins or ends in the hole turns the tool in it as well.

    Args:
        result: the program; collects the findings.
        real: the paths to be judged.
        wanted: what the CAM file asks for.
        on_axis: (m,) row of the hole along whose axis a path motion runs, -1 for none.
        limits: tilt [rad] and distance from the axis [m] that are allowed.
        shift: how far [m] commanded points may be off the real ones.
    """
    motion = np.flatnonzero(on_axis >= 0)
    row = on_axis[motion]
    ends = np.stack([motion - 1, motion])
    from_top = wanted.top[row] - real.end_point[real.case[row], ends]
    height = np.einsum("kij,ij->ki", from_top, wanted.axis[row])
    side = np.linalg.norm(from_top - height[..., None] * wanted.axis[row], axis=2)
    off = angle_between(result.paths.end_axis[ends], wanted.axis[row])
    inside = height.min(axis=0) < wanted.clear[row] - ON_TOP - shift
    for kind, values, most, unit, text in (
        (RunKind.AXIS, off, limits[0], DEG, "tilted by {:.4f} deg in the hole"),
        (RunKind.PATH, side, limits[1], MM, "{:.4f} mm beside the axis of the hole"),
    ):
        worst = values.max(axis=0)
        bad = np.flatnonzero(inside & (worst > most))
        more = f", {len(bad)} such motions" if len(bad) > AT_MOST else ""
        for place in bad[np.argsort(-worst[bad], kind="stable")][:AT_MOST].tolist():
            words = f"the tool is {text.format(worst[place] / unit)}{more}"
            result.finding(kind, int(motion[place]), words)
