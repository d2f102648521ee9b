"""Frozen data types that the layers hand to each other; no numerics beyond shape checks."""

from postproc.model.modelfile import ModelFile, Registration, entry, load_model, save_model
from postproc.model.plan import BLEND_SHARE, LEAST_BLEND, AlongPath, MoveKind, MoveRole, Plan
from postproc.model.reach import Reach
from postproc.model.toolpath import (
    CUTS,
    ORIENT,
    WORKING,
    Arcs,
    CamSetup,
    CamTool,
    Cycle,
    CycleKind,
    Event,
    EventKind,
    MotionKind,
    Operation,
    ToolPath,
    WordClass,
    WordUse,
)
