"""What stands between two key tags of a cut: spin and tilt interpolated over arc length.

The spin is measured against a cross direction that is carried along the path by the smallest
rotation from tool axis to tool axis (parallel transport): its *twist*. Every tag between two key
tags keeps its own tip and axis; only the freedom about the axis is interpolated. The paper
interpolates the first roll angle of the inverse rotation (Jiao et al. 2022, Eqs. 28-37), which
fails where that angle wraps, where the tool is vertical, and by the signs printed; this is the same
where the paper's holds. Motions that no pose can run are told beforehand: a search would have to
refute each step over them on its own.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray, Table, numbered, taken
from postproc.geometry import angle_between
from postproc.planning.checks import LARGEST_TURN, Lines, Reason, poses_between
from postproc.planning.search.keytags import arc_length
from postproc.planning.search.tilt_steps import as_arcs
from postproc.planning.states import (
    Placement,
    Problem,
    cross_axes,
    cut_into,
    rounded_spin,
    spin_values,
)
from postproc.records import dataclass
from postproc.units import DEG, TURN

_LONG = 0.5
"""Only longer motions [m] are looked at on their way: both ends of others tell as much."""
_LOOKS = (
    (np.array([0.25, 0.5, 0.75]), 60.0 * DEG),
    (np.arange(1.0, 16.0) / 16.0, 1.0 * DEG),  # near the edge of reach few spins do
)
"""At these shares of them, in such steps of spin [rad]: what passes one look is passed."""


def carried_twist(placement: Placement) -> FloatArray:
    """Return (n,) [rad] what to add to the spin of each tag for its twist along the path.

    As the arm sees the path: where a positioner turns the work along it, the tool that stands still
    in robroot does not twist.
    """
    n = len(placement)
    axis = placement.axis_base(np.arange(n))
    first, _ = cross_axes(placement.tool_axis)
    cross = placement.R_base_tcp @ first
    R_robroot_base = placement.base(placement.external)[..., :3, :3]
    if R_robroot_base.ndim == 3 and np.ptp(R_robroot_base, axis=0).max(initial=0.0) > ROUNDING:
        axis = np.einsum("nij,nj->ni", R_robroot_base, axis)
        cross = np.einsum("nij,nj->ni", R_robroot_base, cross)
    k = np.cross(axis[:-1], axis[1:])
    cosine = np.einsum("ij,ij->i", axis[:-1], axis[1:])
    u = cross[:-1]
    along = np.einsum("ij,ij->i", k, u) / np.maximum(1.0 + cosine, 1e-12)
    carried = u * cosine[:, None] + np.cross(k, u) + k * along[:, None]
    sine = np.einsum("ij,ij->i", np.cross(carried, cross[1:]), axis[1:])
    step = np.arctan2(sine, np.einsum("ij,ij->i", carried, cross[1:]))
    return np.concatenate([[0.0], np.cumsum(step)])


@dataclass(frozen=True, slots=True)
class Rows(Table):
    """Tags of spans between key tags, one a row: the span (k,), the tag (k,), share (k,) 0..1.

    The last row of every span is its end; its start has no row.
    """

    span: IndexArray
    tag: IndexArray
    share: FloatArray


@dataclass(frozen=True, slots=True)
class Interpolation:
    """How attitudes run between key tags.

    ``way`` (n,) [m]: length of the path; ``carried`` (n,) [rad]: twist at spin 0; ``may_tilt``,
    ``is_cut`` (n,): tags that may tilt, that are entered by a cut; ``infeasible`` (n,): the
    ``Reason`` why no pose can run that cut, or none.
    """

    way: FloatArray
    carried: FloatArray
    may_tilt: BoolArray
    is_cut: BoolArray
    infeasible: IndexArray

    @classmethod
    def of(cls, problem: Problem) -> Interpolation:
        """Return the interpolation along the path of a problem."""
        place = problem.placement
        is_cut = cut_into(problem.toolpath)
        way = arc_length(problem.toolpath)
        return cls(way, carried_twist(place), place.may_tilt, is_cut, infeasible(problem, way))

    def rows(self, first: IndexArray, last: IndexArray) -> Rows:
        """Return the tags behind ``first`` (m,) up to ``last`` (m,) of every span."""
        count = last - first
        span, place = numbered(count)
        place += 1
        a, b = first[span], last[span]
        tag = a + place
        length = self.way[b] - self.way[a]
        by_length = (self.way[tag] - self.way[a]) / np.where(length > ROUNDING, length, 1.0)
        share = np.where(length > ROUNDING, by_length, place / np.maximum(count[span], 1))
        share[tag == b] = 1.0
        return Rows(span, tag, share)

    def attitudes(
        self, rows: Rows, tags: tuple[IndexArray, IndexArray], ends: tuple[FloatArray, FloatArray]
    ) -> FloatArray:
        """Return the attitudes (k, 3) [rad] of rows; the twist goes the short way round.

        Args:
            rows: of the spans.
            tags: first and last (m,) of the spans.
            ends: attitudes (m, 3) there.
        """
        start, end = ends[0][:, 0] + self.carried[tags[0]], ends[1][:, 0] + self.carried[tags[1]]
        turn = end - start
        turn -= TURN * np.round(turn / TURN)
        spin = (start[rows.span] - self.carried[rows.tag]) + rows.share * turn[rows.span]
        way = taken((ends[1] - ends[0])[:, 1:], rows.span)
        tilt = taken(ends[0][:, 1:], rows.span) + rows.share[:, None] * way
        tilt[~self.may_tilt[rows.tag]] = 0.0
        result = np.column_stack([rounded_spin(spin), tilt])
        at_end = rows.share == 1.0
        result[at_end] = ends[1][rows.span[at_end]]
        return result

    def spin_of(self, tags: IndexArray, twist: FloatArray) -> FloatArray:
        """Return the spin (k,) [rad] of tags (k,) at twists (k,)."""
        return rounded_spin(twist - self.carried[tags])


def infeasible(problem: Problem, way: FloatArray) -> IndexArray:
    """Return the ``Reason`` (n,) for which no cut leads to a tag from the one before, or none.

    The tool axis turns by more than one motion can, or somewhere on the way the arm reaches no
    pose, at whatever spin.

    Args:
        problem: what is asked.
        way: (n,) [m] length of the path.
    """
    place, n = problem.placement, len(problem)
    found = np.full(n, int(Reason.NONE), dtype=np.int64)
    cuts = np.flatnonzero(cut_into(problem.toolpath))
    cuts = cuts[cuts > 0]
    cuts = cuts[place.given[cuts] & place.given[cuts - 1]]
    turn = angle_between(place.axis_base(cuts - 1), place.axis_base(cuts))
    lean = np.abs(problem.tilts).sum(axis=1).max()
    found[cuts[turn > LARGEST_TURN + 2.0 * lean]] = Reason.SINGULAR
    if not lean:
        long = cuts[way[cuts] - way[cuts - 1] > _LONG]
        for shares, step in _LOOKS:
            out = [_is_out_of_reach(problem, tag, shares, step) for tag in long.tolist()]
            long = long[np.array(out, dtype=np.bool_)]
        found[long] = Reason.UNREACHABLE
    return found


def _is_out_of_reach(problem: Problem, tag: int, shares: FloatArray, step: float) -> bool:
    """Return whether the arm somewhere on the way to a tag reaches no pose at all."""
    place, spins = problem.placement, spin_values(step, -np.pi, np.pi)
    last, row = np.full(len(spins), tag), np.arange(len(spins)).repeat(len(shares))
    nothing, any_ = np.zeros((len(spins), 6)), np.zeros(len(spins), dtype=np.int64)
    external = place.external[last - 1], place.external[last]
    ends = place.tcp(last - 1, spins), place.tcp(last, spins)
    lines = Lines(*ends, nothing, nothing, any_, any_ == 0, external)
    as_arcs(problem, last, lines)
    share = np.tile(shares, len(spins))
    flange = place.flange(poses_between(lines, row, share), lines.external_at(row, share))
    reached = problem.kinematics.ik(flange)[1].any(axis=1)
    return not reached.reshape(len(spins), -1).any(axis=0).all()
