"""postproc: CAM toolpaths to checked KUKA programs, and the gap between simulation and robot.

>>> import postproc as pp                                         # doctest: +SKIP
>>> cell = pp.load_cell("cell.toml")                              # doctest: +SKIP
>>> job = pp.convert(pp.read("part.cls", cell), cell)             # doctest: +SKIP
>>> job.good, job.findings                                        # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from postproc.api import (
        Cell,
        DiagnosisJob,
        DiffReport,
        Finding,
        IdentifyJob,
        Job,
        ModelFile,
        PostprocError,
        Prediction,
        Severity,
        ToolPath,
        VerifyReport,
        convert,
        diagnose,
        diff,
        identify,
        lint,
        load_cell,
        load_model,
        predict,
        read,
        verify,
    )

from postproc.version import __version__

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
    "__version__",
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


def __getattr__(name: str) -> object:
    # numpy, pinocchio and the rest load when the first name is asked for: `postproc --help` is fast
    if name in __all__:
        return getattr(import_module("postproc.api"), name)
    raise AttributeError(f"module 'postproc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
