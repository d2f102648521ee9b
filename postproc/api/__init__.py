"""What Python programs and the command line call alike; ``postproc`` itself offers these names."""

from postproc.api.cells import Cell, check, explain, load_cell, new_cell, robots, sample
from postproc.api.job import Job
from postproc.api.measurements import diagnose, identify, predict
from postproc.api.parts import holes, inspect, load_model, read
from postproc.api.places import fit_base, place
from postproc.api.programs import batch, convert, diff, lint, stiffness, verify
from postproc.batch import BatchOutcome
from postproc.codes import Entry
from postproc.comparison import DiffReport
from postproc.errors import Finding, PostprocError, Severity
from postproc.gap import Prediction
from postproc.jobs.check_cell import CellCheck
from postproc.jobs.diagnose import DiagnosisJob
from postproc.jobs.fit_base import BaseJob
from postproc.jobs.identify import IdentifyJob
from postproc.jobs.inspect import Inspection
from postproc.jobs.measuring_plan import MeasuringPlan
from postproc.jobs.new_cell import CellDraft
from postproc.jobs.place import PlaceJob
from postproc.jobs.stiffness import SpinStiffness
from postproc.model import ModelFile, ToolPath
from postproc.verification import VerifyReport

__all__ = [
    "BaseJob",
    "BatchOutcome",
    "Cell",
    "CellCheck",
    "CellDraft",
    "DiagnosisJob",
    "DiffReport",
    "Entry",
    "Finding",
    "IdentifyJob",
    "Inspection",
    "Job",
    "MeasuringPlan",
    "ModelFile",
    "PlaceJob",
    "PostprocError",
    "Prediction",
    "Severity",
    "SpinStiffness",
    "ToolPath",
    "VerifyReport",
    "batch",
    "check",
    "convert",
    "diagnose",
    "diff",
    "explain",
    "fit_base",
    "holes",
    "identify",
    "inspect",
    "lint",
    "load_cell",
    "load_model",
    "new_cell",
    "place",
    "predict",
    "read",
    "robots",
    "sample",
    "stiffness",
    "verify",
]
