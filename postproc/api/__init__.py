"""What Python programs and the command line call alike; ``postproc`` itself offers these names."""

from postproc.api.cells import Cell, load_cell, new_cell
from postproc.api.job import Job
from postproc.api.programs import batch, convert, diff, holes, lint, predict
from postproc.batch import BatchOutcome
from postproc.codes import Entry
from postproc.comparison import DiffReport
from postproc.errors import Finding, PostprocError, Severity
from postproc.gap import Prediction
from postproc.jobs.check_cell import CellCheck, check
from postproc.jobs.diagnose import DiagnosisJob, diagnose
from postproc.jobs.explain import explain
from postproc.jobs.fit_base import BaseJob, fit_base
from postproc.jobs.given import load_model, read
from postproc.jobs.identify import IdentifyJob, identify
from postproc.jobs.inspect import Inspection, inspect
from postproc.jobs.measuring_plan import MeasuringPlan, sample
from postproc.jobs.new_cell import CellDraft
from postproc.jobs.place import PlaceJob, place
from postproc.jobs.robots import robots
from postproc.jobs.stiffness import SpinStiffness, stiffness
from postproc.jobs.verify import verify
from postproc.model import ModelFile, ToolPath
from postproc.verification import VerifyReport
