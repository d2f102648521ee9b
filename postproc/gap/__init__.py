"""The gap between simulation and the real robot: effects, fit, selection, verdict."""

from postproc.gap.answers import (
    Along,
    Diagnosis,
    NextPose,
    Part,
    Prediction,
    Reach,
    along,
    diagnose,
    document,
    model_file,
    next_poses,
    parts,
    predict,
    questions,
    reassessed,
    summary,
)
from postproc.gap.data import Samples
from postproc.gap.effect import EFFECTS, Basis, Effect, Parameter, State, register
from postproc.gap.fit import pose_problem
from postproc.gap.robot_model import RobotModel, effect_of

__all__ = [
    "EFFECTS",
    "Along",
    "Basis",
    "Diagnosis",
    "Effect",
    "NextPose",
    "Parameter",
    "Part",
    "Prediction",
    "Reach",
    "RobotModel",
    "Samples",
    "State",
    "along",
    "diagnose",
    "document",
    "effect_of",
    "model_file",
    "next_poses",
    "parts",
    "pose_problem",
    "predict",
    "questions",
    "reassessed",
    "register",
    "summary",
]
