"""What a conversion can do to its worker; imported there, so it needs little."""

import os
import time

from postproc.batch.child import JobResult, attempt


def misbehave(job):
    """Stand in for a conversion: what to do is the job's name."""
    return attempt(job, lambda: _as_named(job))


def _as_named(job):
    if job.key == "hang":
        time.sleep(60)
    if job.key == "die":
        os._exit(9)
    if job.key == "eat":
        bytearray(8 * 1024**3)
    return JobResult(job.key, "ok", errors=())
