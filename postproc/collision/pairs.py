"""Which bodies are tested against each other.

Tested: every link and every tool solid against workpiece and obstacles; the tool against links
0 to 5; links that are not neighbours. Never tested:

- neighbouring links (i, i+1), which share a joint;
- links (3, 5) and (4, 6): the mechanical stops of a wrist keep them apart;
- the tool against link 6, to which it is bolted;
- link 0 against obstacles, of which it stands on one; on a rail it is tested above its foot;
- workpiece and obstacles against each other: the part lies on its fixture;
- a pair of links that touches at the zero pose, at the cannon pose (0, -90, 90, 0, 0, 0), or at
  every one of ``SAMPLES`` poses spread over the limits: it touches by construction.

Some solids are too thick, not the bodies that they stand for: a tool that touches link 4 or 5 at
every one of these poses (a generated hull, an adapter drawn into the wrist), and outlines of links.
Such pairs are tested with thinner solids (``thin``): of both links, or of the link beside the tool.
Outlines of links (0, 2), (2, 4) and (3, 6) are so from the start: they meet where the bodies do
not, (0, 2) over up to a quarter of the poses of A1 and A2, (2, 4) over most of A3 for some light
arms, (3, 6) over the last sixth of A5 for every third arm.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray, Table
from postproc.collision.bodies import WORLD, Body
from postproc.records import dataclass
from postproc.units import DEG

SAMPLES = 64
TOOL = ("tool", "cutting")
Pair = tuple[int, int]
"""Two bodies by their numbers."""
_PRIMES = (2, 3, 5, 7, 11, 13)
_OWN_WRIST = 5
"""From the tool to this link only axis 6 turns: what distance they keep is the maker's affair."""
_APART_BY_STOPS = {(3, 5), (4, 6)}
OUTLINE_SHARES = {(0, 2): 0.9, (2, 4): 0.87, (3, 6): 0.8}
"""Size at which outlines that meet are tested. Against the meshes of 45 arms (`tools.outlines
meeting`): of (0, 2) contact is missed in at most 0.1 % of the poses of A1 and A2, and 3.1 % that
are free are refused; of (2, 4) up to 2.7 % and 7.7 % of those of A3 and A4, near the ends of A3.
(3, 6) never meet, up to the stops of A5, on 50 measured arms; their outlines do on 57 of 159."""


@dataclass(frozen=True, slots=True)
class PairTable(Table):
    """Pairs of bodies in fixed order, by the first body, then the second.

    Args:
        first, second: (p,) indices of bodies; ``second`` never moves less than ``first`` is fixed.
        margin: (p,) [m], a distance up to this counts as a collision; 0 for a cutting solid and
            the workpiece, whose distance is the CAM file's affair.
        is_self: (p,) no distance is asked of them: both are links of the robot, the tool and the
            wrist that carries it, or a part that turns and what stands beside it.
        is_wrist: (p,) the tool and a link of the wrist.
        in_contact: (p,) tested where contact is allowed; out_of_contact: (p,) where it is not.
    """

    first: np.ndarray
    second: np.ndarray
    margin: FloatArray
    is_self: BoolArray
    is_wrist: BoolArray
    in_contact: BoolArray
    out_of_contact: BoolArray


def candidate_pairs(
    bodies: tuple[Body, ...],
    stand_ins: int,
    clearance: float,
    thin: Mapping[Pair, Pair],
    *,
    part_turns: bool = False,
    rides: bool = False,
) -> PairTable:
    """Return all pairs that may have to be tested.

    The last ``stand_ins`` bodies stand for others: cutting solids pulled back by the contact depth
    against the workpiece where contact is allowed; thinner solids, ``thin``: the pair that is
    tested instead of a pair. A part that turns (``part_turns``) may meet what stands in the room;
    the base of an arm that ``rides`` as well. Links keep no clearance from each other: their
    distances are the maker's affair; nor does a base from the bed that it rides on.
    """
    count = len(bodies) - stand_ins
    rows = []
    for a in range(count):
        for b in range(a + 1, count):
            one, two = bodies[a], bodies[b]
            beside = part_turns and (one.kind, two.kind) == ("workpiece", "obstacle")
            beside |= rides and one.link == 0 and two.kind == "obstacle"
            if not (beside or _is_tested(one, two)):
                continue
            touching = one.kind == "cutting" and two.kind == "workpiece"
            is_wrist = two.kind in TOOL and one.link in (_OWN_WRIST - 1, _OWN_WRIST)
            is_self = one.kind == two.kind == "link" or (is_wrist and one.link == _OWN_WRIST)
            is_self |= beside
            first, second = thin.get((a, b), (a, b))
            margin = 0.0 if is_self or touching else clearance
            rows.append((first, second, margin, is_self, is_wrist, not touching, True))
    for a in range(count, len(bodies)):
        for b in range(count):
            if bodies[a].kind == "cutting" and bodies[b].kind == "workpiece":
                rows.append((a, b, 0.0, False, False, True, False))
    columns = list(zip(*rows, strict=True)) or [()] * 7
    kinds = (np.int64, np.int64, np.float64, np.bool_, np.bool_, np.bool_, np.bool_)
    return PairTable(*(np.array(c, dtype=k) for c, k in zip(columns, kinds, strict=True)))


def _is_tested(one: Body, two: Body) -> bool:
    """Return whether a pair with ``one`` before ``two`` in the order of bodies is tested."""
    if one.link == two.link or one.link == WORLD:
        return False
    if two.link == WORLD:
        return not (one.link == 0 and two.kind == "obstacle")
    if two.kind in TOOL:
        return one.link <= _OWN_WRIST
    return two.link - one.link > 1 and (one.link, two.link) not in _APART_BY_STOPS


def outlines_that_meet(bodies: tuple[Body, ...]) -> dict[Pair, float]:
    """Return the pairs of outlines that are thinner from the start, and their size."""
    outline = {body.link: number for number, body in enumerate(bodies) if body.is_outline}
    return {
        (outline[a], outline[b]): share
        for (a, b), share in OUTLINE_SHARES.items()
        if {a, b} <= outline.keys()
    }


def neutral_poses(q_min: FloatArray, q_max: FloatArray) -> FloatArray:
    """Return the zero pose and the cannon pose (2, 6) [rad], moved into the limits."""
    poses = np.array([[0.0] * 6, [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]]) * DEG
    return np.clip(poses, q_min, q_max)


def spread_poses(q_min: FloatArray, q_max: FloatArray) -> FloatArray:
    """Return ``SAMPLES`` poses (n, 6) [rad] of the Halton sequence over the limits."""
    index = np.arange(1, SAMPLES + 1)
    unit = np.zeros((SAMPLES, 6))
    for joint, base in enumerate(_PRIMES):
        digits, scale = index.copy(), 1.0 / base
        while digits.any():
            unit[:, joint] += scale * (digits % base)
            digits //= base
            scale /= base
    low = np.asarray(q_min)
    return low + unit * (np.asarray(q_max) - low)
