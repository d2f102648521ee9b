"""A campaign made ready for diagnosis: gap against the given model, candidates, rows kept apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, Rows
from postproc.cell import Cell
from postproc.errors import DataError, SourceRef
from postproc.gap.data import (
    Designs,
    Samples,
    Seen,
    Split,
    columns_of,
    designs,
    samples_of,
    seen_by,
    split,
)
from postproc.gap.effect import EFFECTS, Effect, Kind, Setting
from postproc.gap.fit.noise import Wander, wanders
from postproc.gap.fit.registration import register_loaded, rows_on_the_arm
from postproc.gap.robot_model import RobotModel, States, arm_of, effect_of, evaluate
from postproc.kinematics import Kinematics
from postproc.measurement import (
    MeasurementSet,
    SetUps,
    frames_of,
    has_points,
    in_robroot,
    points_of,
    readings_of,
    reads_points,
    set_ups,
)
from postproc.model import ModelFile, Registration
from postproc.records import dataclass
from postproc.units import MM

WIDE = 20.0
"""Widening of the priors of the frames under registration: practically free."""
LARGEST_SEARCH = 1500
"""Rows used for searching; more make it slower and no better."""
_FEWEST = 12
_READINGS = 2
"""Readings, three a row, that each number of an effect needs."""
_FRAMES = 9
"""Numbers of a registration."""
_FARTHEST = 50.0 * MM
"""Usual gap beyond which the rows are of another frame."""
_SEED = 5
_ALL = slice(None)


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows with the gap (n, 3) [m] that the given model leaves, and what may explain it.

    measured: (n, 3) in robroot; given: states of the model; registered: frames are fitted anyway;
    searchable: (n,) rows for the search (not sealed, thinned); not_testable: effect to columns;
    instrument: (n,) sd per axis of each reading [m], where file or cell give it; seen: what rows
    read, where not all of them read three coordinates of one sd: there the gap is along that alone.
    """

    measurements: MeasurementSet
    samples: Samples
    measured: FloatArray
    given: States
    gap: FloatArray
    effects: tuple[Effect, ...]
    settings: Mapping[str, Setting]
    not_testable: Mapping[str, tuple[str, ...]]
    split: Split
    design: Designs
    searchable: BoolArray
    registration: Registration | None
    set_ups: SetUps
    instrument: FloatArray | None
    wanders: tuple[Wander, ...]
    seen: Seen | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.samples)

    @property
    def always(self) -> tuple[str, ...]:
        """Blocks that are in every subset."""
        frames = [e for e in self.effects if e.kind == Kind.REGISTRATION]
        return tuple(e.name for e in frames if e.of_several or self.registration is not None)

    @property
    def relative(self) -> FloatArray:
        """(n,) sd of each reading against the usual one."""
        if self.instrument is None:
            return np.ones(len(self))
        return np.asarray(self.instrument / np.sqrt(np.mean(self.instrument**2)))

    @property
    def whole(self) -> BoolArray:
        """(n,) rows that read all three coordinates."""
        return has_points(self.measurements)

    def around(self, states: States) -> tuple[Problem, States]:
        """Return the same rows, distances taken along the lines to points near the real ones.

        What they are read against is found anew from these points, and nothing of it is left in
        the states.
        """
        if self.seen is None:
            return self, states
        count, moved = self.seen.references.shape[2], dict(states)
        for name, state in states.items():
            if effect_of(name).of_several and count:
                theta = np.append(state.theta[:-count], np.zeros(count))
                moved[name] = replace(state, theta=theta)
        point = evaluate(self.samples, moved)[0]
        seen, measured, _ = seen_by(self.seen.readings, point, self.seen.frame)
        samples = replace(self.samples, references=seen.references if count else None)
        here = replace(self, seen=seen, measured=measured, samples=samples)
        return replace(here, gap=here.rest(evaluate(samples, self.given)[0])), moved

    def rest(self, point: FloatArray, rows: Rows | slice = _ALL) -> FloatArray:
        """Return what rows read beside points (n, 3) [m]: nothing where they do not look."""
        return self.onto(self.measured[rows] - point, rows)

    def onto(self, moved: FloatArray, rows: Rows | slice = _ALL) -> FloatArray:
        """Return what rows see of motions (n, 3) [m]."""
        if self.seen is None:
            return moved
        return np.asarray(np.einsum("nij,nj->ni", self.seen.onto[rows], moved))

    def size(self, rest: FloatArray, rows: Rows | slice = _ALL) -> FloatArray:
        """Return the 3D lengths (n,) [m] of errors (n, 3) of rows, over their relative sd."""
        if self.seen is None:
            return np.asarray(np.linalg.norm(rest, axis=1) / self.relative[rows])
        return self.seen.rows(rows).size(rest) / self.relative[rows]

    def by(self, weight: FloatArray, rows: Rows | slice = _ALL) -> FloatArray:
        """Return weights (n,) of rows over their relative sd: (n,), or roots (n, 3, 3)."""
        scale = np.asarray(weight / self.relative[rows])
        return scale if self.seen is None else scale[:, None, None] * self.seen.root[rows]


def pose_problem(
    measurements: MeasurementSet,
    kinematics: Kinematics,
    cell: Cell,
    model: ModelFile | None = None,
    registered: bool = False,
) -> Problem:
    """Return a campaign ready for diagnosis.

    Raises:
        DataError: GAP003 too few rows, GAP004 rows of an unregistered frame, GAP007 rows of a
            station that the given model does not know.
    """
    place = SourceRef(measurements.path, int(measurements.line[0]))
    if len(measurements) < _FEWEST:
        count = len(measurements)
        raise DataError(
            "GAP003", f"{count} rows are too few to diagnose, at least {_FEWEST}", place
        )
    known = model.registration if model is not None else None
    frame = None if registered else known
    rows = set_ups(measurements)
    robot = RobotModel.of(kinematics, cell, model)
    samples = samples_of(robot.arm, measurements)
    given = robot.usable(samples)
    measured = np.asarray(measurements.position)
    registration = None
    if registered:
        on_arm, whole = rows_on_the_arm(samples, given), np.flatnonzero(has_points(measurements))
        registration = register_loaded(
            samples.rows(whole), measured[whole], given, rows.rows(whole), on_arm[whole], place
        )
        frame = registration
    if frame is not None:
        samples = samples_of(arm_of(kinematics, cell, frame), measurements)
        samples, measured = seen_in(frame, samples, measured, rows, place)
    point, seen = evaluate(samples, given)[0], None
    instrument = _instrument(measurements, cell)
    if not reads_points(measurements, cell.instrument):
        readings = readings_of(measurements, cell.instrument, cell.instrument.sigma).firm
        T_measured_robroot = np.eye(4) if frame is None else frames_of(frame, rows)
        seen, measured, usual = seen_by(readings, point, T_measured_robroot)
        if seen.references.shape[2]:
            samples = replace(samples, references=seen.references)
        instrument = usual if np.isfinite(usual).all() else None
        count = int(has_points(measurements).sum())
        if instrument is None and count < _FEWEST:
            raise DataError(
                "GAP003",
                f"{count} rows with three coordinates are too few to tell the noise, expected"
                f" {_FEWEST}, or sigma_mm of each reading",
                place,
            )
    gap = measured - point
    if not registered:
        _require_near(gap, place)
    several = (registered and rows.several) or samples.references is not None
    effects, not_testable = testable(samples, given, registered, several)
    settings = {
        e.name: given[e.name].setting if e.name in given else e.prepare(samples) for e in effects
    }
    parts = split(samples, measurements.group)
    return Problem(
        measurements,
        samples,
        measured,
        given,
        gap,
        effects,
        settings,
        not_testable,
        parts,
        designs(samples, measurements.group),
        _thinned(~parts.sealed),
        registration,
        rows,
        instrument,
        wanders(samples, rows.unit),
        seen,
    )


def seen_in(
    frame: Registration,
    samples: Samples,
    measured: FloatArray,
    rows: SetUps,
    place: SourceRef | None,
) -> tuple[Samples, FloatArray]:
    """Return samples at the measured point of each row, and the readings (n, 3) in robroot.

    Raises:
        DataError: GAP007 a station or reflector that the registration does not know.
    """
    try:
        points = points_of(frame, rows)
        inside = in_robroot(frame, measured, rows)
    except KeyError as unknown:
        raise DataError(
            "GAP007",
            f"station or reflector {unknown.args[0]!r} is not in the registration of the model",
            place,
            hint="--register fits it to these rows; several files are stations of their own",
        ) from None
    if rows.several:
        samples = samples.with_set_ups(rows, points)
    return samples, inside


def _instrument(measurements: MeasurementSet, cell: Cell) -> FloatArray | None:
    """Return the sd per axis of each reading (n,) [m] by file or cell, None if unknown."""
    if measurements.sigma is not None:
        return np.asarray(measurements.sigma)
    if cell.instrument.sigma is not None:
        return np.full(len(measurements), cell.instrument.sigma)
    return None


def _require_near(gap: FloatArray, place: SourceRef) -> None:
    usual = float(np.median(np.linalg.norm(gap, axis=1)))
    if usual > _FARTHEST:
        raise DataError(
            "GAP004",
            f"the measured points lie {usual / MM:.0f} mm beside the simulated ones: another frame"
            " or tool point?",
            place,
            hint="--register fits the measured frame and the reflector's place first",
        )


def rows_for(effect: Effect, samples: Samples, frames: int) -> int:
    """Return how many rows the numbers of an effect need beside those of the frames.

    Two readings for each number; those of waves, tables and frames are chosen otherwise.
    """
    if effect.periodic or effect.on_demand or effect.kind == Kind.REGISTRATION:
        return 0
    own = len(effect.parameters(samples.arm, effect.prepare(samples)))
    return -(-_READINGS * (own + frames) // 3)


def testable(
    samples: Samples, given: States, registered: bool, several: bool
) -> tuple[tuple[Effect, ...], dict[str, tuple[str, ...]]]:
    """Return what can be tested, and for the rest the columns that are missing or constant."""
    effects: list[Effect] = []
    frames = _FRAMES if registered else 0
    missing: dict[str, tuple[str, ...]] = {}
    for name, effect in EFFECTS:
        if effect.of_several and not several:
            continue
        lacking = [column for column in effect.needs if not _informative(samples, column)]
        needed = 0 if lacking else rows_for(effect, samples, frames)
        if needed > len(samples):
            if not effect.is_alternative:
                missing[name] = (f"about {needed} rows",)
        elif not lacking:
            if name not in given or not effect.is_fixed(given[name].setting):
                effects.append(effect)
        elif not effect.is_alternative:
            missing[name] = tuple(c for column in lacking for c in columns_of(column))
    return tuple(effects), missing


def _informative(samples: Samples, column: str) -> bool:
    if not samples.has(column):
        return False
    values = samples.column(column)
    if values.dtype.kind not in "fiu":
        return len(np.unique(values)) > 1
    return bool(np.any(values)) and bool(np.any(np.ptp(values, axis=0) > 0.0))


def _thinned(rows: BoolArray) -> BoolArray:
    index = np.flatnonzero(rows)
    if len(index) <= LARGEST_SEARCH:
        return rows
    kept = np.random.default_rng(_SEED).choice(index, LARGEST_SEARCH, replace=False)
    out = np.zeros(len(rows), dtype=bool)
    out[kept] = True
    return out
