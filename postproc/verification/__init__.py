"""Runs program text on the robot model and compares it with the CAM file."""

from postproc.verification.cam import Tolerances
from postproc.verification.report import Expectation, Played, VerifyReport
from postproc.verification.verify import verify
