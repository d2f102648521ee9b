"""The rows of a campaign as the fit sees them, and the arm's model."""

from postproc.gap.data.dataset import (
    FADES,
    Arm,
    Samples,
    column_functions,
    columns_of,
    first_moment_torque,
    load_moment,
    make_samples,
    samples_of,
    weight_moment,
    weight_torque,
)
from postproc.gap.data.reference import reference_of
from postproc.gap.data.seen import Seen, seen_by
from postproc.gap.data.split import Designs, Split, designs, split
