"""Many inputs: parallel, resumable, checkable."""

from postproc.batch.check import check_batch, junit_xml
from postproc.batch.jobs import Job
from postproc.batch.run import BatchOptions, BatchOutcome, call_of, page_file, run_batch
