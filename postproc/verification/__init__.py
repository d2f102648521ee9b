"""Runs program text on the robot model and compares it with the CAM file."""

from postproc.verification.report import Expectation, Played, Tolerances, VerifyReport
from postproc.verification.verify import verify
