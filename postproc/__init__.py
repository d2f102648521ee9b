"""postproc: CAM toolpaths to checked KUKA programs, and the gap between simulation and robot.

>>> import postproc as pp                                         # doctest: +SKIP
>>> cell = pp.load_cell("cell.toml")                              # doctest: +SKIP
>>> job = pp.convert(pp.read("part.cls", cell), cell)             # doctest: +SKIP
>>> job.good, job.findings                                        # doctest: +SKIP
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from postproc.api import *

from postproc.version import __version__

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
    "__version__",
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


class _Names(ModuleType):
    """The package; rooms that are called as a public name do not take its place when imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in __all__ and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Names


def __getattr__(name: str) -> object:
    # numpy, pinocchio and the rest load when the first name is asked for: `postproc --help` is fast
    if name in __all__:
        return getattr(import_module("postproc.api"), name)
    raise AttributeError(f"module 'postproc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
