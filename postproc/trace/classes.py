"""What the rest is a function of, when no effect of the library is its cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.units import MM

if TYPE_CHECKING:
    from postproc.trace.answer import PathDiagnosis

BINS = 24
"""Values of a condition that are told apart."""
PIECES = 8
"""Pieces of the recording of which every second one is left out."""
SHARE = 0.25
"""Least share of the rest that a condition must account for, on rows that were left out."""


def unexplained(found: PathDiagnosis) -> list[dict[str, Any]]:
    """Return the classes of what is left, largest first; none where it is like noise."""
    if found.verdict != "unexplained":
        return []
    rest = found.rest
    total = float(np.sum(rest**2))
    shares = [(_drifts(rest, found.scene.time), "time", "time")]
    for kind, of, values in _conditions(found):
        share = _accounts(rest, values)
        shares.append((share, kind, of))
    shares.sort(key=lambda item: (-item[0], item[1], item[2]))
    best: dict[str, dict[str, Any]] = {}
    for share, kind, of in shares:
        if share > SHARE and kind not in best:
            size = float(np.sqrt(share * total / len(rest)))
            best[kind] = {"class": kind, "of": of, "rms_mm": round(size / MM, 6)}
            best[kind]["share"] = round(share, 4)
    return list(best.values())


def _conditions(found: PathDiagnosis) -> list[tuple[str, str, FloatArray]]:
    scene = found.scene
    rows: list[tuple[str, str, FloatArray]] = []
    for joint in range(6):
        if np.ptp(scene.recording.command[:, joint]) > 0.0:
            rows.append(("joint", f"q{joint + 1}", scene.recording.command[:, joint]))
            rows.append(("speed", f"qd{joint + 1}", scene.speed[:, joint]))
            rows.append(("approach", f"q{joint + 1}", scene.last_motion[:, joint]))
    for axis, name in enumerate("xyz"):
        rows.append(("place", name, scene.points[:, axis]))
    for effort in (scene.recording.torque, scene.recording.current):
        if effort is not None:
            loads = np.nan_to_num(effort).T
            rows += [("load", f"axis {k + 1}", load) for k, load in enumerate(loads)]
    return rows


def _accounts(rest: FloatArray, values: FloatArray) -> float:
    """Return the share of the rest (n, 3) that a curve over values tells of other long pieces."""
    n = len(rest)
    half = (np.arange(n) * PIECES // n) % 2
    order = np.argsort(values, kind="stable")
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n) * BINS // n
    levels = np.unique(values)
    if len(levels) <= BINS:
        place = np.searchsorted(levels, values)
    left = 0.0
    for side in (0, 1):
        fitted, judged = half != side, half == side
        count = np.maximum(np.bincount(place[fitted], minlength=BINS), 1)
        for row in rest.T:
            curve = np.bincount(place[fitted], row[fitted], BINS) / count
            left += float(np.sum((row[judged] - curve[place[judged]]) ** 2))
    return 1.0 - left / max(float(np.sum(rest**2)), 1e-30)


def _drifts(rest: FloatArray, time: FloatArray) -> float:
    """Return the share of the rest (n, 3) that a straight course over time (n,) makes."""
    course = time - time.mean()
    slope = course @ rest / max(float(course @ course), 1e-30)
    return float(np.sum((course[:, None] * slope) ** 2) / max(float(np.sum(rest**2)), 1e-30))
