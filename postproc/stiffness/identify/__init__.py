"""Joint stiffness from measured deflections."""

from postproc.stiffness.identify.constant import TYPICAL_C
from postproc.stiffness.identify.document import identify_document, warnings
from postproc.stiffness.identify.identify import Identification, identify
from postproc.stiffness.identify.models import IdentifyOptions
from postproc.stiffness.identify.observability import (
    Observability,
    ShowingLoad,
    observe,
    showing_load,
    shown_text,
)
