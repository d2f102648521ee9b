"""Fitting effects to rows: linear algebra, registration, noise, waves."""

from postproc.gap.fit.fit import Fit, Free, fit, unit_root, variance
from postproc.gap.fit.noise import LEAST, Noise, Source, gross_faults, noise_of
from postproc.gap.fit.problem import WIDE, Problem, pose_problem, seen_in, testable
from postproc.gap.fit.registration import moved_by, register_loaded
from postproc.gap.fit.revisits import repeats
from postproc.gap.fit.tangent import Parted, Tangent
from postproc.gap.fit.waves import HIGHEST, LOWEST, STANDING, Projection, Wave, find_waves
