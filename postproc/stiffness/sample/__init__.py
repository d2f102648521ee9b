"""Where to measure: plans for a stiffness campaign."""

from postproc.stiffness.sample.measuring import (
    TRACKER_SIGMA,
    Load,
    SampleRequest,
    Sampling,
    csv_text,
    expected_compliance,
    largest_force,
    load_regressors,
    sample_document,
)
from postproc.stiffness.sample.sampling import (
    SamplingPlan,
    SamplingRules,
    best_orientation,
    box_grid,
    choose,
    features,
    plan_sampling,
    reachable,
    travel_order,
)
