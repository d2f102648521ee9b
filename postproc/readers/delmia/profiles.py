"""What motion and accuracy profiles ask for, motion by motion: path speed, axis speed, fly-by.

What no program can keep to is refused like a word, with the lines of its motions; where the user
accepts it, the cell decides as it does where a file says nothing.
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
        "a path speed of a joint motion, which runs at a share of the speed of the axes",
        "give joint motions a profile of the basis Percent; accepted, rapid_percent of the cell "
        "counts",
    ),
    _SHARE: (
        "a share of the largest path speed, which the file does not give",
        "give the speed in m/s, or export GeneralInfo with MaxSpeed; accepted, feed_mm_min of the "
        "cell counts",
    ),
    _BY_SPEED: (
        "a fly-by that begins at a share of the speed, the program approximates by distance",
        "give the accuracy profile the type Distance; accepted, approximation_mm of the cell "
        "counts",
    ),
}
Profile = TypeVar("Profile")


class Profiles:
    """The profiles of a robot, and what of them is refused.

    Args:
        robot: with its profiles.
        faults: of the file.
    """

    def __init__(self, robot: RobotData, faults: Faults) -> None:
        self._robot = robot
        self._faults = faults
        self._lines: dict[str, list[int]] = {}

    def speeds(self, motions: Sequence[Motion], kind: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return what motions (n,) ask for, NaN where that is nothing.

        Args:
            motions: in order.
            kind: (n,) ``MotionKind``.

        Returns:
            Path speed (n,) [m/s] of lines and arcs, share of axis speed (n,) of joint motions.

        Raises:
            ReadError: DEL016 for a profile that is not in the file.
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
        whose profile does not fly by.

        Raises:
            ReadError: DEL016 for a profile that is not in the file.
        """
        blends = np.full(len(motions), np.nan)
        for i, motion in enumerate(motions):
            own = self._named("accuracy", self._robot.blends, motion.accuracy_profile, motion)
            if own is None or (motion.via and own == 0.0):
                continue
            blends[i] = own
            if np.isnan(own):
                self._refuse(_BY_SPEED, motion)
        return blends

    def refused(self) -> tuple[WordUse, ...]:
        """Return what no program keeps to, with its lines."""
        return tuple(
            WordUse(word, WordClass.PROCESS, tuple(lines), _REASONS[word][0], True,
                    _REASONS[word][1])
            for word, lines in self._lines.items()
        )  # fmt: skip

    def _axis_share(self, profile: MotionProfile, motion: Motion) -> float:
        if profile.is_timed or np.isfinite(profile.speed):
            return self._refuse(_TIMED if profile.is_timed else _PATH_SPEED, motion)
        return profile.share

    def _path_speed(self, profile: MotionProfile, motion: Motion) -> float:
        if profile.is_timed:
            return self._refuse(_TIMED, motion)
        if np.isfinite(profile.speed):
            return profile.speed
        if np.isnan(self._robot.max_speed):
            return self._refuse(_SHARE, motion)
        return profile.share * self._robot.max_speed

    def _refuse(self, word: str, motion: Motion) -> float:
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
