"""Many inputs: parallel, resumable, checkable."""

from postproc.batch.check import check_batch
from postproc.batch.jobs import Job
from postproc.batch.junit import junit_xml
from postproc.batch.precheck import call_of
from postproc.batch.run import BatchOptions, BatchOutcome, page_file, run_batch
