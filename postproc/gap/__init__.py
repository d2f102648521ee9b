"""The gap between simulation and the real robot: effects, fit, selection, verdict."""

from postproc.gap.answers import (
    APPROACH,
    Along,
    Diagnosis,
    Kept,
    NextPose,
    Open,
    Outlook,
    Part,
    Prediction,
    Promise,
    Reach,
    along,
    calibrated_urdf,
    certificate,
    diagnose,
    document,
    is_ambiguous,
    kept,
    last_set_up,
    model_file,
    next_poses,
    noise_like,
    noise_words,
    outlook,
    parts,
    predict,
    questions,
    reassessed,
    summary,
)
from postproc.gap.data import Arm, Samples, make_samples
from postproc.gap.effect import EFFECTS, Basis, Effect, Kind, Parameter, Setting, State, register
from postproc.gap.fit import pose_problem
from postproc.gap.posterior import USUAL_NOISE
from postproc.gap.robot_model import (
    RobotModel,
    act,
    columns,
    effect_of,
    stiffness_of,
    stiffness_tables,
)
