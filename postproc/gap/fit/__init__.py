"""Fitting effects to rows: linear algebra, registration, noise, waves, intervals."""

from postproc.gap.fit.fit import Fit, Free, fit
from postproc.gap.fit.intervals import deviations
from postproc.gap.fit.linear import Block, NormalEquations, block_of
from postproc.gap.fit.load_place import register_loaded
from postproc.gap.fit.noise import Noise, Saturated, repeats, saturated
from postproc.gap.fit.problem import Problem, pose_problem
from postproc.gap.fit.registration import moved_by
from postproc.gap.fit.regression import Regression, Subset
from postproc.gap.fit.waves import Projection, Wave, find_waves, is_gear_error

__all__ = [
    "Block",
    "Fit",
    "Free",
    "Noise",
    "NormalEquations",
    "Problem",
    "Projection",
    "Regression",
    "Saturated",
    "Subset",
    "Wave",
    "block_of",
    "deviations",
    "find_waves",
    "fit",
    "is_gear_error",
    "moved_by",
    "pose_problem",
    "register_loaded",
    "repeats",
    "saturated",
]
