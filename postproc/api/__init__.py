"""What Python programs and the command line call alike; ``postproc`` itself offers these names."""

from postproc.api.job import Job
from postproc.api.measurements import diagnose, identify, predict
from postproc.api.programs import convert, diff, lint, load_cell, load_model, read, verify
from postproc.cell import Cell
from postproc.comparison import DiffReport
from postproc.errors import Finding, PostprocError, Severity
from postproc.gap import Prediction
from postproc.jobs.diagnose import DiagnosisJob
from postproc.jobs.identify import IdentifyJob
from postproc.model import ModelFile, ToolPath
from postproc.verification import VerifyReport

__all__ = [
    "Cell",
    "DiagnosisJob",
    "DiffReport",
    "Finding",
    "IdentifyJob",
    "Job",
    "ModelFile",
    "PostprocError",
    "Prediction",
    "Severity",
    "ToolPath",
    "VerifyReport",
    "convert",
    "diagnose",
    "diff",
    "identify",
    "lint",
    "load_cell",
    "load_model",
    "predict",
    "read",
    "verify",
]
