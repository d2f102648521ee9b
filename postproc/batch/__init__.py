"""Many inputs: parallel, resumable, checkable."""

from postproc.batch.check import check_batch
from postproc.batch.jobs import Job, Overrides, find_inputs, load_overrides, make_jobs
from postproc.batch.junit import junit_xml
from postproc.batch.precheck import require_call
from postproc.batch.run import BatchOptions, BatchOutcome, run_batch
from postproc.batch.sections import parse_rule

__all__ = [
    "BatchOptions",
    "BatchOutcome",
    "Job",
    "Overrides",
    "check_batch",
    "find_inputs",
    "junit_xml",
    "load_overrides",
    "make_jobs",
    "parse_rule",
    "require_call",
    "run_batch",
]
