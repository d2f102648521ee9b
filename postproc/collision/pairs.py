"""Which bodies are tested against each other.

Tested: every link and every tool solid against workpiece and obstacles; the tool against links
0 to 3; links that are not neighbours. Never tested:

- neighbouring links (i, i+1), which share a joint;
- links (3, 5) and (4, 6): the mechanical stops of a wrist keep them apart;
- the tool against the wrist, links 4 to 6, which carries it;
- link 0 against obstacles: the robot stands on one of them, or on the bed of its rail;
- workpiece and obstacles against each other: the part lies on its fixture;
- a pair of links that touches at the zero pose, at the cannon pose (0, -90, 90, 0, 0, 0), or at
  every one of ``SAMPLES`` poses spread over the limits: it touches by construction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, Table
from postproc.collision.bodies import WORLD, Body
from postproc.units import DEG

SAMPLES = 64
_PRIMES = (2, 3, 5, 7, 11, 13)
_WRIST = 4
_APART_BY_STOPS = {(3, 5), (4, 6)}


@dataclass(frozen=True, slots=True)
class PairTable(Table):
    """Pairs of bodies in fixed order, by the first body, then the second.

    Args:
        first, second: (p,) indices of bodies; ``second`` never moves less than ``first`` is fixed.
        margin: (p,) [m], a distance up to this counts as a collision.
        is_self: (p,) both are links of the robot.
        in_contact: (p,) tested where contact is allowed; out_of_contact: (p,) where it is not.
    """

    first: np.ndarray
    second: np.ndarray
    margin: FloatArray
    is_self: BoolArray
    in_contact: BoolArray
    out_of_contact: BoolArray


def candidate_pairs(bodies: tuple[Body, ...], pulled_back: int, clearance: float) -> PairTable:
    """Return all pairs that may have to be tested.

    The last ``pulled_back`` bodies are cutting solids pulled back by the contact depth: they stand
    for the cutting solids against the workpiece where contact is allowed. Links keep no clearance
    from each other: their distances are the maker's affair.
    """
    count = len(bodies) - pulled_back
    rows = []
    for a in range(count):
        for b in range(a + 1, count):
            one, two = bodies[a], bodies[b]
            if not _is_tested(one, two):
                continue
            touching = one.kind == "cutting" and two.kind == "workpiece"
            is_self = one.kind == two.kind == "link"
            rows.append((a, b, 0.0 if is_self else clearance, is_self, not touching, True))
    for a in range(count, len(bodies)):
        for b in range(count):
            if bodies[b].kind == "workpiece":
                rows.append((a, b, 0.0, False, True, False))
    columns = list(zip(*rows, strict=True)) or [()] * 6
    kinds = (np.int64, np.int64, np.float64, np.bool_, np.bool_, np.bool_)
    return PairTable(*(np.array(c, dtype=k) for c, k in zip(columns, kinds, strict=True)))


def _is_tested(one: Body, two: Body) -> bool:
    """Return whether a pair with ``one`` before ``two`` in the order of bodies is tested."""
    if one.link == two.link or one.link == WORLD:
        return False
    if two.link == WORLD:
        return not (one.link == 0 and two.kind == "obstacle")
    if two.kind in ("tool", "cutting"):
        return one.link < _WRIST
    return two.link - one.link > 1 and (one.link, two.link) not in _APART_BY_STOPS


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
