"""Joint stiffness from measured deflections."""

from postproc.stiffness.identify.constant import TYPICAL_C
from postproc.stiffness.identify.identified import document, warnings
from postproc.stiffness.identify.identify import Identification, IdentifyOptions, identify
from postproc.stiffness.identify.observability import (
    Observability,
    ShowingLoad,
    observe,
    showing_load,
    shown_text,
)

__all__ = [
    "TYPICAL_C",
    "Identification",
    "IdentifyOptions",
    "Observability",
    "ShowingLoad",
    "document",
    "identify",
    "observe",
    "showing_load",
    "shown_text",
    "warnings",
]
