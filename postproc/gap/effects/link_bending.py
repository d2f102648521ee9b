"""The links bend under load between the joints (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples, load_moment, weight_moment
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register

LINKS = (1, 2, 3)


@register
class LinkBending(Effect):
    """Each large link has a soft spot in its middle that the moment there turns.

    Nine numbers for the outside load and nine for the own weight; bending about a joint's own
    axis is nearly that joint's compliance. Without it a wrong link geometry is named.
    """

    name = "link_bending"
    title = "behaves like links that bend under load"
    source = "Klimchik et al. 2014, virtual joint in each link"
    action = "measure two targets, on the tool and on the forearm, under load"
    kind = Kind.ALTERNATIVE
    needs = ("wrench",)
    conditions = ("load",)
    parameter_list = tuple(
        Parameter(f"link_{link}_{axis}", 0.2, joint=link) for link in LINKS for axis in "xyz"
    )
    """Compliances relative to that of joint 2, about the link frame's axes."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn the rest of the arm at the middle of each link."""
        del setting
        return Basis(link=bending(samples, outside=True))


def bending(samples: Samples, outside: bool) -> FloatArray:
    """Return (n, 7, 6, 9): the turn at the middle of links 1, 2, 3 under the moment there."""
    origins, _, _ = samples.arm.link_constants()
    compliance = float(samples.arm.reference.c_joint[1])
    link = np.zeros((len(samples), 7, 6, 9))
    for index, k in enumerate(LINKS):
        middle = 0.5 * origins[k]
        R = samples.frames[:, k, :3, :3]
        at = samples.frames[:, k, :3, 3] + R @ middle
        moment = (
            load_moment(samples, at) if outside else weight_moment(samples, at, range(k + 1, 7))
        )
        local = np.einsum("nji,nj->ni", R, moment) * compliance
        for axis in range(3):
            turn = np.zeros((len(samples), 3))
            turn[:, axis] = local[:, axis]
            link[:, k, :3, 3 * index + axis] = turn
            link[:, k, 3:, 3 * index + axis] = np.cross(middle, turn)
    return link
