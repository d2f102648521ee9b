"""The external axes: where they stand, or how they move, while the arm does each tag."""

from postproc.planning.external.planner import plan_with_external_axes, travel_moves
