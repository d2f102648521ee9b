"""Tables of options of a cell file in file units, with their defaults, to options in SI units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.cell.cell import KrlOptions, Limits, Motion, Optimize, Reading, Thin, TiltRange
from postproc.cell.forms import routines
from postproc.cell.schema import (
    ImportTable,
    KrlTable,
    LimitsTable,
    MotionTable,
    OptimizeTable,
)
from postproc.units import DEG, MEGABYTE, MM, MM_PER_MIN, MS, PERCENT


def limits_of(table: LimitsTable) -> Limits:
    """Return the margins of ``[limits]``."""
    depth = table.contact_depth_mm
    return Limits(
        joint_margin=table.joint_margin_deg * DEG,
        singularity=table.singularity_deg * DEG,
        clearance=table.clearance_mm * MM,
        contact_depth=float("inf") if depth is None else depth * MM,
    )


def optimize_of(table: OptimizeTable) -> Optimize:
    """Return the options of ``[optimize]``."""
    bound = table.loss_bound_percent
    return Optimize(
        objective=table.objective,
        index=table.index,
        step=table.step_deg * DEG,
        range=_angles(table.range_deg),
        strategy=table.strategy,
        preset=table.preset,
        turns=table.turns,
        refine=table.refine,
        spin_round=table.spin_round_deg * DEG,
        keep_loss=table.keep_loss_percent * PERCENT,
        key_every=table.key_every_mm * MM,
        key_corner=table.key_corner_deg * DEG,
        key_tags=tuple(str(tag) for tag in table.key_tags),
        loss_bound=None if bound is None else bound * PERCENT,
        free_order=table.free_order,
        pins={tag: spin * DEG for tag, spin in table.pins.items()},
        tilt=TiltRange(
            lead=_angles(table.lead_deg),
            side=_angles(table.side_tilt_deg),
            step=table.tilt_step_deg * DEG,
        ),
    )


def motion_of(table: MotionTable) -> Motion:
    """Return the options of ``[motion]``."""
    rapid = table.rapid_percent * PERCENT
    return Motion(
        rapid=rapid,
        rapid_speed=table.rapid_speed_m_s * rapid,
        feed=float("nan") if table.feed_mm_min is None else table.feed_mm_min * MM_PER_MIN,
        approximation=table.approximation_mm * MM,
        corner_tolerance=table.corner_tolerance_mm * MM,
        home=None if table.home_deg is None else np.array(table.home_deg) * DEG,
        approach=table.approach_mm * MM,
        points=table.points,
        chord=table.chord_mm * MM,
        arcs=table.arcs,
        thin=None
        if table.thin is None
        else Thin(table.thin.chord_mm * MM, table.thin.axis_deg * DEG),
        retract_in_cuts=table.retract_in_cuts,
        path_entry=table.path_entry,
    )


def reading_of(table: ImportTable) -> Reading:
    """Return the options of ``[import]``."""
    return Reading(**{**table.model_dump(), "accept_words": tuple(table.accept_words)})


def krl_of(table: KrlTable, hole: Sequence[str] = ()) -> KrlOptions:
    """Return the options of ``[krl]``; the template as the file names it.

    Args:
        table: as in the file.
        hole: routines of ``[process] hole``: called ``PP_`` and their name unless the table says.
    """
    return KrlOptions(
        emitter=table.emitter,
        template=table.template,
        max_points_per_file=table.max_points_per_file,
        split=table.split,
        motion=table.motion,
        points=table.points,
        kss=table.kss,
        home=table.home,
        advance=table.advance,
        orientation_speed=table.orientation_speed_deg_s * DEG,
        path_speed_max=table.path_speed_max_m_s,
        block_time=table.block_ms * MS,
        memory=table.memory_mb * MEGABYTE,
        cam_lines=table.cam_lines,
        setup=table.setup,
        hooks_example=table.hooks_example,
        hooks=routines(table.hooks, hole),
        outputs=dict(table.outputs),
        inputs=dict(table.inputs),
        stops_advance=None
        if table.hooks.stops_advance is None
        else tuple(table.hooks.stops_advance),
    )


def _angles(limits: Sequence[float]) -> tuple[float, float]:
    low, high = limits
    return low * DEG, high * DEG
