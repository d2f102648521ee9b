"""What the process asks of planning and verification alike: feeds, loads, order, words, tilt."""

from postproc.process.assignment import (
    Assignment,
    ToolStretch,
    assign,
    bases_named,
    carried,
    words_settled,
)
from postproc.process.feeds import (
    AXIS_SHARE,
    LEAST_SHARE,
    LOWERED_FROM,
    LOWERED_TO,
    assumptions,
    feed_findings,
    feeds_of,
    least_feeds,
)
from postproc.process.loads import load_cases, operation_loads, weight_wrench
from postproc.process.looks import SHALLOW, SMALL, as_served, from_below, looks, stationary
from postproc.process.machining import machining_findings
from postproc.process.material import (
    ALONG_AXIS,
    MACHINING_SPEED,
    back_off,
    feeds_out,
    in_material,
    in_the_cut,
    machining_speeds,
    on_the_way_out,
    out_of_cut,
    rapid_speeds,
)
from postproc.process.order import hole_places, hole_runs, reordered
from postproc.process.passing import (
    apart,
    may_be_passed,
    only,
    repeated_tags,
    repeats,
    without_repeats,
)
from postproc.process.spindle import (
    COOLANTS,
    START_HINT,
    Stretch,
    coolant_mode,
    driven,
    may_stand,
    start_findings,
    started_by_none,
    stretches,
    switched_off,
    with_turns,
)
from postproc.process.strokes import (
    FEED_OUT,
    LEAST_PECK,
    MOST_PECKS,
    TAPS,
    hole_calls,
    peck_count,
    pecks,
    with_orientation,
)
from postproc.process.tilt import PLUNGING, SHARPEST
from postproc.process.unit import NUMBER, hole_steps, holes_served, restart_notes, unit_findings
from postproc.process.words import refusals, word_findings
