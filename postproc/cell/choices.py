"""What a key of the cell can be set to, where it is one of a few words, and who has said it."""

from __future__ import annotations

from enum import StrEnum, auto

from postproc.records import dataclass


class Index(StrEnum):
    """Stiffness index: 1/(n^T C n), or the ellipsoid index of Jiao et al. 2022."""

    COMPLIANCE = auto()
    ELLIPSOID = auto()


class Strategy(StrEnum):
    """How the spins of a path are chosen: over all tags, at key tags, or tag by tag."""

    GLOBAL = auto()
    SMOOTH = auto()
    EACH = auto()


class Preset(StrEnum):
    """What stiffness is traded against time: how much of each an objective by name takes."""

    STIFFEST = auto()
    BALANCED = auto()
    FASTEST = auto()


class PointService(StrEnum):
    """How points of a list without a depth are served."""

    AUTO = auto()
    TOUCH = auto()
    PATH = auto()


class SpindleStart(StrEnum):
    """Who starts the spindle: the program by its routines, the end effector, or a person."""

    PROGRAM = auto()
    UNIT = auto()
    HAND = auto()


class PathEntry(StrEnum):
    """How a cut is entered that the CAM file does not lead into: along the tool axis, or not."""

    AXIS = auto()
    NONE = auto()


class ArcMotion(StrEnum):
    """Arcs as circular motions where possible, or as lines."""

    CIRC = auto()
    LIN = auto()


class MotionStyle(StrEnum):
    """Motion commands of a program."""

    DENSE = auto()
    SPLINE = auto()
    SPLINE_BLOCK = auto()
    FORMS = auto()


class PointPlace(StrEnum):
    """Where the points of a program stand."""

    INLINE = auto()
    DAT = auto()


class Kss(StrEnum):
    """System software of the controller: forms and motions that it knows."""

    V5 = "5"
    V8_3 = "8.3"
    V8_5 = "8.5"
    V8_6 = "8.6"
    V8_7 = "8.7"

    @property
    def has_splines(self) -> bool:
        """Whether SPTP, SLIN, SCIRC and spline blocks exist: from KSS 8 on."""
        return self is not Kss.V5

    @property
    def has_parameter_folds(self) -> bool:
        """Whether inline forms keep their parameters in a fold of their own: from KSS 8.6 on."""
        return self in (Kss.V8_6, Kss.V8_7)


class HomeStyle(StrEnum):
    """How a program goes home: by axis values, to XHOME of the controller, or by its form."""

    AXES = auto()
    XHOME = auto()
    FORM = auto()


class RobotSolids(StrEnum):
    """What stands for the links of a built-in arm: outlines, or a convex hull of each of them."""

    SIMPLE = auto()
    OUTLINE = auto()


class Split(StrEnum):
    """Where a sub-program begins."""

    POINTS = auto()
    OPERATIONS = auto()


class Provenance(StrEnum):
    """How far a number can be trusted."""

    DATASHEET = "datasheet"
    PUBLISHED = "published"
    MEASURED = "measured"
    USER = "user"
    ASSUMED = "assumed"


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a number comes from: kind, source in words, trust (A to C where it was weighed)."""

    provenance: Provenance
    source: str = ""
    trust: str = ""
