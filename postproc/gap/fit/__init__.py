"""Fitting effects to rows: linear algebra, registration, noise, waves, intervals."""

from postproc.gap.fit.fit import Fit, Free, fit, moved_points, variance, without_blocks
from postproc.gap.fit.intervals import deviations
from postproc.gap.fit.linear import (
    Block,
    NormalEquations,
    Subset,
    block_of,
    design_matrix,
    predicted,
)
from postproc.gap.fit.load_place import register_loaded
from postproc.gap.fit.memory import REST, Memory, memory_of
from postproc.gap.fit.noise import (
    LEAST,
    Noise,
    Saturated,
    Source,
    gross_faults,
    noise_of,
    saturated,
)
from postproc.gap.fit.problem import WIDE, Problem, pose_problem, seen_in, testable
from postproc.gap.fit.registration import moved_by
from postproc.gap.fit.regression import Regression
from postproc.gap.fit.waves import STANDING, Projection, Wave, find_waves, is_gear_error

__all__ = [
    "LEAST",
    "REST",
    "STANDING",
    "WIDE",
    "Block",
    "Fit",
    "Free",
    "Memory",
    "Noise",
    "NormalEquations",
    "Problem",
    "Projection",
    "Regression",
    "Saturated",
    "Source",
    "Subset",
    "Wave",
    "block_of",
    "design_matrix",
    "deviations",
    "find_waves",
    "fit",
    "gross_faults",
    "is_gear_error",
    "memory_of",
    "moved_by",
    "moved_points",
    "noise_of",
    "pose_problem",
    "predicted",
    "register_loaded",
    "saturated",
    "seen_in",
    "testable",
    "variance",
    "without_blocks",
]
