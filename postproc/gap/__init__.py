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
from postproc.gap.data import Arm, Samples, make_samples
from postproc.gap.effect import EFFECTS, Basis, Effect, Kind, Parameter, Setting, State, register
from postproc.gap.fit import NormalEquations, block_of, pose_problem
from postproc.gap.joint_stiffness import stiffness_of, stiffness_tables
from postproc.gap.robot_model import RobotModel, act, columns, effect_of

__all__ = [
    "EFFECTS",
    "Along",
    "Arm",
    "Basis",
    "Diagnosis",
    "Effect",
    "Kind",
    "NextPose",
    "NormalEquations",
    "Parameter",
    "Part",
    "Prediction",
    "Reach",
    "RobotModel",
    "Samples",
    "Setting",
    "State",
    "act",
    "along",
    "block_of",
    "columns",
    "diagnose",
    "document",
    "effect_of",
    "make_samples",
    "model_file",
    "next_poses",
    "parts",
    "pose_problem",
    "predict",
    "questions",
    "reassessed",
    "register",
    "stiffness_of",
    "stiffness_tables",
    "summary",
]
