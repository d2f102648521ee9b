"""The advance run: by how many motions the interpreter may be ahead of the arm.

The controller reads up to $ADVANCE motions ahead. What a statement does then happens so many
motions early, unless something before it makes the interpreter wait for the arm: a wait, a stop, an
output, an input, the position. ``CONTINUE`` in the line before takes that away again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from postproc.controller.recorder import Recorder
from postproc.controller.state import MotionState

STOPPING = ("$IN[", "$OUT[", "$ANIN[", "$ANOUT[", "$POS_ACT", "$AXIS_ACT")
"""System variables that stop the advance run where they are read or written."""


class AdvanceRun:
    """Where the interpreter has last waited for the arm.

    Args:
        state: knows $ADVANCE.
        recorder: knows the motions so far.
    """

    def __init__(self, state: MotionState, recorder: Recorder) -> None:
        self._state, self._recorder = state, recorder
        self._met = 0
        self._earliest = 0
        self.is_continued = False
        """Whether ``CONTINUE`` stands in the line before."""

    @property
    def early(self) -> int:
        """Return by how many motions what is run now may happen early."""
        if self._recorder.in_trigger:
            return 0
        since = len(self._recorder) - self._met
        return min(int(self._state.values.system["$ADVANCE"]), since)

    def stop(self) -> int:
        """Wait for the arm, unless CONTINUE forbids it; return by how many motions early."""
        if not (self.is_continued or self._recorder.in_trigger):
            self._met = len(self._recorder)
        return self.act()

    def act(self) -> int:
        """Note that something is done here; return by how many motions early."""
        early = self.early
        self._earliest = max(self._earliest, early)
        return early

    @contextmanager
    def body(self) -> Iterator[None]:
        """Note from here on by how many motions early the lines of a routine act."""
        outside, self._earliest = self._earliest, 0
        yield
        self._earliest = max(self._earliest, outside)

    @property
    def earliest(self) -> int:
        """Return by how many motions early the lines of the present body have acted at most."""
        return self._earliest
