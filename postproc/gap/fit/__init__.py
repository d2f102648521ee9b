"""Fitting effects to rows: linear algebra, registration, noise, evidence."""

from postproc.gap.fit.bench import Bench
from postproc.gap.fit.evidence import (
    ABSORBED_GAIN,
    SMALLEST_SUSPECT,
    Evidence,
    evidence_of,
    imitated,
    is_absorbed,
    small,
    smallest_part,
    unique_part,
    unphysical,
    weakest,
)
from postproc.gap.fit.fit import Fit, Free, fit
from postproc.gap.fit.intervals import deviations
from postproc.gap.fit.linear import Block, Gram, block_of
from postproc.gap.fit.load_place import register_loaded
from postproc.gap.fit.noise import Noise, Saturated, repeats, saturated
from postproc.gap.fit.problem import Problem, pose_problem
from postproc.gap.fit.registration import moved_by
from postproc.gap.fit.select import CLEAR, Search, Subset, search
from postproc.gap.fit.waves import Context, Wave, find_waves, is_gear_error

__all__ = [
    "ABSORBED_GAIN",
    "CLEAR",
    "SMALLEST_SUSPECT",
    "Bench",
    "Block",
    "Context",
    "Evidence",
    "Fit",
    "Free",
    "Gram",
    "Noise",
    "Problem",
    "Saturated",
    "Search",
    "Subset",
    "Wave",
    "block_of",
    "deviations",
    "evidence_of",
    "find_waves",
    "fit",
    "imitated",
    "is_absorbed",
    "is_gear_error",
    "moved_by",
    "pose_problem",
    "register_loaded",
    "repeats",
    "saturated",
    "search",
    "small",
    "smallest_part",
    "unique_part",
    "unphysical",
    "weakest",
]
