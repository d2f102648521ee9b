"""What the process asks of planning and verification alike: feeds, loads, order, words, tilt."""

from postproc.process.claims import (
    Claims,
    ToolStretch,
    bases_named,
    carried,
    claimed,
    tool_words,
    words_settled,
)
from postproc.process.coolant import COOLANTS, coolant_mode
from postproc.process.feeds import (
    AXIS_SHARE,
    LOWERED_FROM,
    LOWERED_TO,
    feed_findings,
    feeds_of,
    least_feeds,
)
from postproc.process.loads import load_cases, operation_loads, weight_wrench
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
    rapid_speeds,
)
from postproc.process.order import hole_places, hole_runs, reordered
from postproc.process.passing import may_be_passed, only, without_repeats
from postproc.process.pointlist import as_served
from postproc.process.repeats import apart, repeated_tags, repeats
from postproc.process.spindle import Stretch, may_stand, stretches, switched_off
from postproc.process.strokes import (
    CHIP_LIFT,
    FEED_OUT,
    LEAST_PECK,
    MOST_PECKS,
    TAPS,
    hole_calls,
    peck_count,
    pecks,
    turns_at,
    with_orientation,
    with_turns,
)
from postproc.process.tilt import PLUNGING, SHARPEST
from postproc.process.unit import NUMBER, hole_steps, holes_served, restart_notes, unit_findings
from postproc.process.words import refusals, word_findings

__all__ = [
    "ALONG_AXIS",
    "AXIS_SHARE",
    "CHIP_LIFT",
    "COOLANTS",
    "FEED_OUT",
    "LEAST_PECK",
    "LOWERED_FROM",
    "LOWERED_TO",
    "MACHINING_SPEED",
    "MOST_PECKS",
    "NUMBER",
    "PLUNGING",
    "SHARPEST",
    "TAPS",
    "Claims",
    "Stretch",
    "ToolStretch",
    "apart",
    "as_served",
    "back_off",
    "bases_named",
    "carried",
    "claimed",
    "coolant_mode",
    "feed_findings",
    "feeds_of",
    "feeds_out",
    "hole_calls",
    "hole_places",
    "hole_runs",
    "hole_steps",
    "holes_served",
    "in_material",
    "in_the_cut",
    "least_feeds",
    "load_cases",
    "machining_findings",
    "machining_speeds",
    "may_be_passed",
    "may_stand",
    "on_the_way_out",
    "only",
    "operation_loads",
    "peck_count",
    "pecks",
    "rapid_speeds",
    "refusals",
    "reordered",
    "repeated_tags",
    "repeats",
    "restart_notes",
    "stretches",
    "switched_off",
    "tool_words",
    "turns_at",
    "unit_findings",
    "weight_wrench",
    "with_orientation",
    "with_turns",
    "without_repeats",
    "word_findings",
    "words_settled",
]
