"""Torques and moments that the arm carries: outside wrench and own weight, reference masses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data.dataset import Samples
from postproc.geometry import apply, skew


def weight_torque(samples: Samples) -> FloatArray:
    """Return (n, 6) torque of the links' weight on the joints [N*m]."""
    reference, mass = samples.arm.reference, samples.arm.reference.link_mass
    moment = np.zeros((len(samples), 6, 3))
    for link in range(6):
        com = apply(samples.frames[:, link + 1], reference.link_com[link])
        moment[:, : link + 1] += mass[link] * com[:, None]
    carried = np.cumsum(mass[::-1])[::-1]
    moment -= carried[:, None] * samples.frames[:, 1:, :3, 3]
    torque = np.einsum("nij,nji->nj", samples.axes, moment @ skew(reference.gravity))
    return np.asarray(torque)


def first_moment_torque(samples: Samples, R: FloatArray, link: int) -> FloatArray:
    """Return (n, 6, 3) torque on the joints of a first moment of mass along x, y, z of R [m/s^2].

    Args:
        samples: rows.
        R: (n, 3, 3) axes of the moment, in robroot.
        link: 1..6, the link that carries the mass.
    """
    pull = np.swapaxes(R, 1, 2) @ skew(samples.arm.reference.gravity)
    torque = np.swapaxes(samples.axes, 1, 2) @ np.swapaxes(pull, 1, 2)
    torque[:, link:] = 0.0
    return np.asarray(torque)


def carried_torque(samples: Samples) -> FloatArray:
    """Return (n, 6) torque of weight and, where it was logged, of the outside wrench [N*m]."""
    torque = weight_torque(samples)
    return torque + samples.load_torque() if samples.has("wrench") else torque


def load_moment(samples: Samples, at: FloatArray) -> FloatArray:
    """Return (n, 3) moment of the outside wrench about points (n, 3), robroot [N*m]."""
    wrench = samples.column("wrench")
    return np.asarray(np.cross(samples.load_point - at, wrench[:, :3]) + wrench[:, 3:])


def weight_moment(samples: Samples, at: FloatArray, links: Iterable[int]) -> FloatArray:
    """Return (n, 3) moment about points (n, 3) of the weight of some links [N*m]."""
    reference = samples.arm.reference
    moment = np.zeros((len(samples), 3))
    for link in links:
        com = apply(samples.frames[:, link], reference.link_com[link - 1])
        moment += (com - at) @ skew(reference.link_mass[link - 1] * reference.gravity)
    return moment
