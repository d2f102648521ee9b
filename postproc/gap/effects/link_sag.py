"""The links bend under their own weight (an alternative, never named)."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register
from postproc.gap.effects.link_bending import LINKS, bending


@register
class LinkSag(Effect):
    """As link bending, under the weight of what is beyond each link.

    Without it a sag of a third of the usual size is called a counterbalance beside link errors.
    """

    name = "link_sag"
    title = "behaves like links that bend under the arm's weight"
    source = "Klimchik et al. 2014, virtual joint in each link"
    action = "measure two targets, on the tool and on the forearm, over the whole workspace"
    kind = Kind.ALTERNATIVE
    conditions = ("pose",)
    parameter_list = tuple(
        Parameter(f"link_{link}_{axis}", 0.1, joint=link) for link in LINKS for axis in "xyz"
    )
    """Compliances relative to that of joint 2, about the link frame's axes."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn the rest of the arm at the middle of each link."""
        del setting
        return Basis(link=bending(samples, outside=False))
