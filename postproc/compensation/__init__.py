"""Commands moved so that the loaded real tool lands on the CAM points."""

from postproc.compensation.along import as_planned, split
from postproc.compensation.compensate import compensate, with_shift_margin
from postproc.compensation.real_arm import RealArm, cell_with_model, left_out, loads
