"""Runs KRL text as the controller does; knows no planner and passes no judgement."""

from postproc.controller.control import Activation
from postproc.controller.interpreter import Interpreter, run
from postproc.controller.modules import called_names, load_program
from postproc.controller.motions import Motions
from postproc.controller.runtime import UNKNOWN, pose_of, text_of
from postproc.controller.state import INITMOV, STOPMESS
from postproc.controller.trace import (
    Blend,
    EventWord,
    MotionType,
    Settings,
    Trace,
    TraceEvent,
    World,
)
