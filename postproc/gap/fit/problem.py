"""A campaign made ready for diagnosis: gap against the given model, candidates, rows kept apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import DataError, SourceRef
from postproc.gap.data import COLUMN_NAMES, Samples, Split, samples_of, split
from postproc.gap.effect import EFFECTS, Effect, Setting, registration_effects
from postproc.gap.fit.linear import Block, block_of
from postproc.gap.fit.load_place import register_loaded
from postproc.gap.fit.registration import rows_on_the_arm
from postproc.gap.robot_model import RobotModel, States, arm_of, evaluate
from postproc.kinematics import Kinematics
from postproc.measurement import MeasurementSet, in_robroot
from postproc.model import ModelFile, Registration
from postproc.units import MM

WIDE = 20.0
"""Widening of the priors of the frames under registration: practically free."""
LARGEST_SEARCH = 1500
"""Rows used for searching; more make it slower and no better."""
_FEWEST = 12
_FARTHEST = 50.0 * MM
"""Usual gap beyond which the rows are of another frame."""
_SEED = 5


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows with the gap (n, 3) [m] that the given model leaves, and what may explain it.

    measured: (n, 3) in robroot; given: states of the model; registered: frames are fitted anyway;
    searchable: (n,) rows for the search (not sealed, thinned); not_testable: effect to columns.
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
    searchable: BoolArray
    registration: Registration | None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.samples)

    @property
    def always(self) -> tuple[str, ...]:
        """Blocks that are in every subset."""
        return registration_effects() if self.registration is not None else ()

    def widen(self, name: str) -> float:
        """Return how far the prior of an effect is widened."""
        return WIDE if name in self.always else 1.0

    def blocks(self, rows: BoolArray) -> tuple[Block, ...]:
        """Return the columns of all candidates but waves, at the pose that the model gives."""
        part = self.samples.rows(np.flatnonzero(rows))
        actual = evaluate(part, self.given)[1]
        return tuple(
            block_of(
                e,
                actual,
                self.settings[e.name],
                widen=self.widen(e.name),
                start=self.given[e.name].theta if e.name in self.given else None,
            )
            for e in self.effects
            if not e.periodic
        )


def pose_problem(
    measurements: MeasurementSet,
    kinematics: Kinematics,
    cell: Cell,
    model: ModelFile | None = None,
    registered: bool = False,
) -> Problem:
    """Return a campaign ready for diagnosis.

    Raises:
        DataError: GAP003 too few rows, GAP004 rows of an unregistered frame.
    """
    place = SourceRef(measurements.path, int(measurements.line[0]))
    if len(measurements) < _FEWEST:
        count = len(measurements)
        raise DataError(
            "GAP003", f"{count} rows are too few to diagnose, at least {_FEWEST}", place
        )
    robot = RobotModel.of(kinematics, cell, model)
    samples = samples_of(robot.arm, measurements)
    given = robot.usable(samples)
    measured = np.asarray(measurements.position)
    registration = None
    if registered:
        registration = register_loaded(samples, measured, given, rows_on_the_arm(samples, given))
    frame = registration or (model.registration if model is not None else None)
    if frame is not None:
        samples = samples_of(arm_of(kinematics, cell, frame), measurements)
        measured = in_robroot(frame, measured)
    gap = measured - evaluate(samples, given)[0]
    if not registered:
        _require_near(gap, place)
    effects, not_testable = _candidates(samples, given)
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
        _thinned(~parts.sealed),
        registration,
    )


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


def _candidates(
    samples: Samples, given: States
) -> tuple[tuple[Effect, ...], dict[str, tuple[str, ...]]]:
    """Return what can be tested, and for the rest the columns that are missing or constant."""
    effects: list[Effect] = []
    missing: dict[str, tuple[str, ...]] = {}
    for name, effect in EFFECTS:
        lacking = [column for column in effect.needs if not _informative(samples, column)]
        if not lacking:
            if name not in given or not effect.is_fixed(given[name].setting):
                effects.append(effect)
        elif not effect.is_alternative:
            missing[name] = tuple(c for column in lacking for c in COLUMN_NAMES[column])
    return tuple(effects), missing


def _informative(samples: Samples, column: str) -> bool:
    if not samples.has(column):
        return False
    values = samples.column(column)
    return bool(np.any(values)) and bool(np.any(np.ptp(values, axis=0) > 0.0))


def _thinned(rows: BoolArray) -> BoolArray:
    index = np.flatnonzero(rows)
    if len(index) <= LARGEST_SEARCH:
        return rows
    kept = np.random.default_rng(_SEED).choice(index, LARGEST_SEARCH, replace=False)
    out = np.zeros(len(rows), dtype=bool)
    out[kept] = True
    return out
