"""What motion and accuracy profiles ask for, motion by motion: path speed, axis speed, fly-by.

Where a profile says what no program can keep to, the cell decides as it does where a file says
nothing, which is a note with the lines of the motions; a speed that is a time is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.model import MotionKind, WordClass, WordUse
from postproc.readers.delmia.records import NAN, Motion, MotionProfile, RobotData
from postproc.readers.text import Faults

_TIMED = "MotionBasis/Time"
_PATH_SPEED = "MotionBasis/Absolute"
_SHARE = "MotionBasis/Percent"
_BY_SPEED = "AccuracyType/Speed"
_REASONS = {
    _TIMED: (
        "the time of a motion, where a program says its speed",
        "give the motion profile the basis Absolute or Percent; accepted, feed_mm_min or "
        "rapid_percent of the cell counts",
    ),
    _PATH_SPEED: (
        "a path speed of a joint motion, which runs at a share of the speed of the axes: "
        "rapid_percent of the cell counts",
        "give joint motions a profile of the basis Percent",
    ),
    _SHARE: (
        "a share of the largest path speed, which the file does not give: feed_mm_min of the cell "
        "counts",
        "give the speed in m/s, or export GeneralInfo with MaxSpeed",
    ),
    _BY_SPEED: (
        "a fly-by that begins at a share of the speed, the program approximates by distance: "
        "approximation_mm of the cell counts",
        "give the accuracy profile the type Distance",
    ),
}
Profile = TypeVar("Profile")


class Profiles:
    """The profiles of a robot, and what of them no program keeps to."""

    def __init__(self, robot: RobotData, faults: Faults) -> None:
        self._robot = robot
        self._faults = faults
        self._lines: dict[str, list[int]] = {}

    def speeds(self, motions: Sequence[Motion], kind: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return path speeds (n,) [m/s] of lines and arcs, share of axis speed of joint motions.

        NaN where they ask for nothing; DEL016 for a profile that is not in the file.
        """
        feed, share = np.full(len(motions), np.nan), np.full(len(motions), np.nan)
        for i, motion in enumerate(motions):
            own = self._named("motion", self._robot.motions, motion.motion_profile, motion)
            if own is None:
                continue
            if kind[i] == MotionKind.JOINT:
                share[i] = self._axis_share(own, motion)
            else:
                feed[i] = self._path_speed(own, motion)
        return feed, share

    def blends(self, motions: Sequence[Motion]) -> FloatArray:
        """Return how far (n,) [m] before their targets motions may be left, 0 for an exact stop.

        NaN where the file leaves it to the cell: without an accuracy profile, and at a via point
        whose profile does not fly by. DEL016 for a profile that is not in the file.
        """
        blends = np.full(len(motions), np.nan)
        for i, motion in enumerate(motions):
            own = self._named("accuracy", self._robot.blends, motion.accuracy_profile, motion)
            if own is None or (motion.via and own == 0.0):
                continue
            blends[i] = own
            if np.isnan(own):
                self._note(_BY_SPEED, motion)
        return blends

    def uses(self) -> tuple[WordUse, ...]:
        """Return what no program keeps to as it stands, with its lines."""
        return tuple(
            WordUse(word, WordClass.PROCESS, tuple(lines), reason, word == _TIMED, hint)
            for word, lines in self._lines.items()
            for reason, hint in [_REASONS[word]]
        )  # fmt: skip

    def _axis_share(self, profile: MotionProfile, motion: Motion) -> float:
        if profile.is_timed or np.isfinite(profile.speed):
            return self._note(_TIMED if profile.is_timed else _PATH_SPEED, motion)
        return profile.share

    def _path_speed(self, profile: MotionProfile, motion: Motion) -> float:
        if profile.is_timed:
            return self._note(_TIMED, motion)
        if np.isfinite(profile.speed):
            return profile.speed
        if np.isnan(self._robot.max_speed):
            return self._note(_SHARE, motion)
        return profile.share * self._robot.max_speed

    def _note(self, word: str, motion: Motion) -> float:
        self._lines.setdefault(word, []).append(motion.line)
        return NAN

    def _named(
        self, what: str, profiles: Mapping[str, Profile], name: str, motion: Motion
    ) -> Profile | None:
        """Return a profile, None where a motion names none or the file has none at all."""
        if not name or not profiles:
            return None
        if name not in profiles:
            raise self._faults.error("DEL016", f"no {what} profile of this name", motion.line, name)
        return profiles[name]
