"""The ways between the tags: connections, detours, cuts, strokes and their speeds."""

from postproc.planning.route.route import HOME, Gap, Route, route
from postproc.planning.route.speeds import ON_THE_SPOT, is_too_fast
from postproc.planning.route.travel import FOLDED, Travel, cell_at, travel_between
from postproc.planning.route.working import step_rows
