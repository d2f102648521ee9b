"""Which effects the rows speak for: one probabilistic model of all that a campaign can show."""

from postproc.gap.posterior.chosen import USUAL_NOISE, posterior
from postproc.gap.posterior.classes import Part, groups_of
from postproc.gap.posterior.evidence import optimum
from postproc.gap.posterior.final import Named, Serving, frames_of, servings, thinned
from postproc.gap.posterior.gates import (
    DECISIVE,
    SMALLEST,
    Judged,
    judged,
    tolerated,
)
from postproc.gap.posterior.names import CLOSE, Name
from postproc.gap.posterior.prior import LOG_SCALES, Candidate, Sort, of_effect, of_group
from postproc.gap.posterior.residual import Dependence
