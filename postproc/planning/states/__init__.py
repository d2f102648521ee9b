"""Which robot states serve a tag and what each costs."""

from postproc.planning.states.candidates import BRANCHES, States, merged, sample, sample_on
from postproc.planning.states.costs import (
    OBJECTIVES,
    TRAVEL,
    TRAVEL_UNIT,
    Objective,
    StateContext,
    Weights,
)
from postproc.planning.states.moves import Chosen, Moves, in_order, moves
from postproc.planning.states.place import (
    NO_POSE,
    Placement,
    cross_axes,
    frames_across,
    has_pose,
    place,
    place_given,
    rounded_spin,
    spin_values,
    stand_ins,
)
from postproc.planning.states.postures import Postures, StrokeEnds, postures
from postproc.planning.states.pricing import context_of, evaluate, strokes_into, take_joints
from postproc.planning.states.problem import (
    HELD,
    Problem,
    Strokes,
    path_normals,
    stiffness_of,
)
from postproc.planning.states.settings import (
    PlanOptions,
    Settings,
    settle,
)
from postproc.planning.states.tilt import (
    BETWEEN,
    REENTRY,
    UPRIGHT,
    beside_in_grid,
    cut_into,
    entered_anew,
    feed_directions,
    leaves_tilt_range,
    tilt_frames,
    tilt_grid,
)
