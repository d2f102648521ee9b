"""Sides of gears at turns and at starts of cuts, against a gear that crosses its gap."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.reversals import _stretches, _swung, _turns
from postproc.paths.moments import directions

HALF = 2e-4
REACH = 2e-3
ALONG = np.linspace(0.0, 0.04, 4001)
TURN = 0.02


def missed(q: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return what the link misses (k,) of q when the motor goes to command and drags it."""
    link = np.empty(len(q))
    link[0] = command[0] - HALF
    for k in range(1, len(q)):
        link[k] = np.clip(link[k - 1], command[k] - HALF, command[k] + HALF)
    return link - q


def path(kind: str) -> np.ndarray:
    back = ALONG - TURN
    return {"gentle": -(back**2) / 0.3, "round": -(back**2) / 0.02, "sharp": -np.abs(back)}[kind]


@pytest.mark.parametrize("kind", ["gentle", "round", "sharp"])
def test_the_link_is_never_farther_off_than_without(kind: str) -> None:
    q = path(kind)
    side = np.sign(directions(q[:, None] * np.ones(6)))[:, 0]
    side[0] = side[1]
    turns = _turns(q, side)
    assert [s for _, s in turns] == [-1.0]
    assert ALONG[turns[0][0]] == pytest.approx(TURN, abs=2e-5)
    now = _swung(ALONG, q, turns, np.full(len(q), REACH), 2.0 * HALF)
    assert np.all(np.abs(np.diff(now)) <= 1.001 * np.diff(ALONG) / REACH)
    assert now[0] == 1.0
    assert now[-1] == -1.0
    off = np.abs(missed(q, q + HALF * now))
    assert off.max() <= 1.001 * HALF
    # with the swing in the middle of the turn half the gap is missed there
    assert off.max() < {"gentle": 0.45, "round": 0.75, "sharp": 1.001}[kind] * HALF
    assert off[ALONG > TURN + 3 * REACH].max() < 1e-9


def test_a_joint_that_turns_where_the_cut_starts_begins_on_the_side_it_goes_on() -> None:
    q = path("sharp")[ALONG >= TURN]
    side = np.full(len(q), -1.0)
    side[:2] = 1.0
    now = _swung(ALONG[: len(q)], q, _turns(q, side), np.full(len(q), REACH), 2.0 * HALF)
    np.testing.assert_array_equal(now, -1.0)


def test_turns_back_and_forth_within_the_reach_stay_between_the_sides() -> None:
    q = 1e-4 * np.sin(ALONG / 1e-4)
    side = np.sign(directions(q[:, None] * np.ones(6)))[:, 0]
    side[0] = side[1]
    now = _swung(ALONG, q, _turns(q, side), np.full(len(q), REACH), 2.0 * HALF)
    assert np.abs(now).max() <= 1.0
    assert np.all(np.abs(np.diff(now)) <= 1.001 * np.diff(ALONG) / REACH)


def test_stretches_begin_where_the_tool_stands() -> None:
    is_cut = np.array([0, 0, 1, 1, 1, 1, 0, 1, 1], dtype=bool)
    border = ~is_cut
    border[3] = True
    assert _stretches(is_cut, border) == [(1, 3), (3, 5), (6, 8)]
