"""A diagnosis for machines (``diagnose --json``) and the model file that follows from it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.cell import Tool
from postproc.gap.answers.along import Along, program
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.kept import Kept
from postproc.gap.answers.next_pose import NextPose
from postproc.gap.answers.shrinkage import rms
from postproc.gap.answers.where import orientation, where
from postproc.gap.data import Samples
from postproc.gap.effect import State
from postproc.gap.fit import moved_by
from postproc.gap.robot_model import effect_of, spread_of
from postproc.model import ModelFile, Reach
from postproc.units import MM

SCHEMA = "postproc.diagnosis/1"
_Z90 = 1.6449
SUREST = 0.98
"""No cause is called with more: of the library alone it may be the best by far, but what is not in
it cannot be excluded better than blind campaigns with unlisted causes show."""
DOUBTED = 0.9
"""The same of a cause beside which something may be left unexplained."""
EVEN = 0.5
"""The same of a cause that another, or a class, would stand for about as well."""


def document(
    diagnosis: Diagnosis,
    proposed: Sequence[NextPose] = (),
    path: Along | None = None,
    promise: Kept | None = None,
    accepted: Collection[str] = (),
) -> dict[str, Any]:
    """Return the JSON object of the contract.

    Args:
        diagnosis: the answer to a campaign.
        proposed: what to measure next.
        path: where the rows lie on a program.
        promise: what came of an earlier diagnosis in this campaign.
        accepted: names that the model holds although the instrument may have caused the same.
    """
    problem, kept = diagnosis.problem, diagnosis.kept
    gap = np.linalg.norm(problem.rest(diagnosis.baseline), axis=1)[kept]
    rest = np.linalg.norm(diagnosis.residual, axis=1)[kept]
    ids = problem.measurements.ids
    return {
        "schema": SCHEMA,
        "verdict": diagnosis.verdict,
        "noise_mm": _mm(diagnosis.noise) if diagnosis.level.known else None,
        "noise": noise(diagnosis),
        "gap": {
            "rms_mm": _mm(rms(gap)),
            "p95_mm": _mm(float(np.quantile(gap, 0.95))),
            "max_mm": _mm(float(gap.max())),
        },
        "where": where(diagnosis) | ({"program": program(diagnosis, path)} if path else {}),
        "effects": effects(diagnosis),
        "adopted": list(diagnosis.adopted),
        "serving": list(diagnosis.serving),
        "withheld": list(diagnosis.withheld(accepted)),
        "shrinkage": _total_shrinkage(diagnosis, accepted),
        **({"before": promise.entry()} if promise else {}),
        "residual": {
            "rms_mm": _mm(rms(rest)),
            "explained_share": round(1.0 - (rms(rest) / max(rms(gap), 1e-12)) ** 2, 4),
            "structured_rms_mm": _mm(diagnosis.structure),
            "depends_on": [
                {"name": t.name, "p_value": float(f"{t.p_value:.3g}"), "rms_mm": _mm(t.rms)}
                for t in diagnosis.tests
            ],
            "resembles": [
                {"name": name, "title": effect_of(name).title, "action": effect_of(name).action}
                for name in diagnosis.resembled
            ],
            "ripple": [{"joint": joint, "periods_per_turn": n} for joint, n in diagnosis.ripple],
        },
        "unexplained": [
            {
                "class": part.kind,
                "of": part.of,
                "rms_mm": _mm(part.rms),
                "shape": part.shape,
                **({"gain_nats": round(part.gain, 1)} if np.isfinite(part.gain) else {}),
            }
            for part in diagnosis.unexplained
        ],
        "registration": _registration(diagnosis),
        "orientation": orientation(diagnosis),
        "remarks": [remark.entry() for remark in problem.measurements.remarks],
        "suspects": [ids[i] for i in np.flatnonzero(diagnosis.suspects)],
        "outliers": [ids[i] for i in np.flatnonzero(diagnosis.outlier)],
        "not_testable": [
            {"name": name, "needs": list(needs)} for name, needs in problem.not_testable.items()
        ],
        "next_measurements": [pose.entry() for pose in proposed],
        "rows": {
            "total": len(problem),
            "sealed": int(problem.split.sealed.sum()),
            "searched": int(problem.searchable.sum()),
        },
    }


def noise(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return how large the noise is and how that is known."""
    level = diagnosis.level
    timed = diagnosis.problem.samples.time is not None and np.isfinite(level.correlation)

    def mm(value: float) -> float | None:
        return _mm(value) if np.isfinite(value) else None

    return {
        "sigma_mm": _mm(level.sigma) if level.known else None,
        "source": str(level.source),
        "freedom": level.freedom,
        "repeats": level.repeats,
        "correlation_s": round(level.correlation, 1) if timed else None,
        "wander_mm": mm(level.wander) if level.known else None,
        "instrument_mm": mm(level.instrument),
        "at_most_mm": mm(level.upper),
        "drift": level.drift or None,
        "conflict": level.conflict or None,
    }


def _registration(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """Return what was fitted first, None if nothing was."""
    fitted = diagnosis.problem.registration
    if fitted is None:
        return None
    return {
        "point_in_flange_mm": np.round(fitted.p_flange_point / MM, 4).tolist(),
        "loads_at": "reflector" if fitted.loads_at_point else "tool point",
    }


def effects(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return every candidate tried, adopted ones first in their order, then by probability."""
    elsewhere = _elsewhere(diagnosis)
    adopted = [
        _adopted(diagnosis, name) | {"transfer": elsewhere.get(name, [])}
        for name in diagnosis.adopted
    ]
    others = []
    for effect in diagnosis.problem.effects:
        name = effect.name
        if name in diagnosis.adopted or effect.is_alternative or name in diagnosis.problem.always:
            continue
        before, after = diagnosis.extra.get(name, (float("nan"), float("nan")))
        others.append(_candidate(diagnosis, name, before, after))
    others.sort(key=lambda e: (-e["probability"], -(e["shrinkage"] or 0.0), e["name"]))
    return adopted + others


def model_file(
    diagnosis: Diagnosis,
    given: ModelFile | None,
    tool: Tool | None = None,
    accepted: Collection[str] = (),
) -> ModelFile:
    """Return the given model with what was adopted or serves, and a fitted registration.

    Args:
        diagnosis: the answer to a campaign.
        given: what the simulation knew before.
        tool: that the arm had on; None: nothing is known of its weight.
        accepted: names that are written although the instrument may have caused the same.
    """
    arm = diagnosis.problem.samples.arm
    tables = dict(given.effects) if given else {}
    instrument = dict(given.instrument) if given else {}
    withheld = diagnosis.withheld(accepted)
    for name in (*diagnosis.adopted, *diagnosis.serving):
        if name in withheld:
            continue
        state, effect = diagnosis.fit.states[name], effect_of(name)
        seen = _seen_state(diagnosis, name) if name in diagnosis.adopted else state
        (tables if effect.is_arms else instrument)[name] = effect.write(seen, arm)
    registration = given.registration if given else None
    if diagnosis.problem.registration is not None:
        rest = rms(np.linalg.norm(diagnosis.residual, axis=1)[diagnosis.kept])
        registration = replace(
            moved_by(diagnosis.problem.registration, diagnosis.fit.states), rms=rest
        )
    return ModelFile(
        tables,
        registration,
        given.notes if given else (),
        has_tool_weight=(given is not None and given.has_tool_weight)
        or (tool is not None and not _logs_weight(diagnosis.problem.samples, tool)),
        reach=reach_of(diagnosis),
        instrument=instrument,
    )


def _logs_weight(samples: Samples, tool: Tool) -> bool:
    """Return whether the loads of every row hold the weight of the tool, which is always on."""
    if samples.wrench is None or not np.isfinite(tool.mass):
        return False
    weight = tool.mass * samples.arm.reference.gravity
    share = samples.wrench[:, :3] @ weight
    return bool(np.all(share >= 0.5 * float(weight @ weight)))


def _seen_state(diagnosis: Diagnosis, name: str) -> State:
    """Return the fitted numbers with NaN for a joint that the data say nothing about."""
    state = diagnosis.fit.states[name]
    part = diagnosis.fit.slices[name]
    own = diagnosis.fit.parameters[part]
    theta = np.array(state.theta)
    per_joint = len(own) >= 6 and [p.joint for p in own[:6]] == [1, 2, 3, 4, 5, 6]
    if per_joint:
        unseen = diagnosis.fit.unseen[part].copy()
        unseen[6:] = False
        theta[unseen] = np.nan
    return State(theta, state.setting)


def _adopted(diagnosis: Diagnosis, name: str) -> dict[str, Any]:
    step = next(s for s in diagnosis.steps if s.name == name)
    effect, arm = effect_of(name), diagnosis.problem.samples.arm
    state = _seen_state(diagnosis, name)
    width = _Z90 * diagnosis.deviation[name]
    low, high = effect.ends(state.theta, width)
    own = diagnosis.name(name)
    return _entry(diagnosis, name, step.before, step.after) | {
        "shrinkage_ci": [round(v, 4) for v in step.interval],
        "parameters": plain(effect.write(state, arm)),
        "interval_90": {
            "low": plain(effect.write(State(low, state.setting), arm)),
            "high": plain(effect.write(State(high, state.setting), arm)),
        },
        "confounded_with": list(own.confounded),
        "rival": own.rival or None,
        "action": effect.action,
    }


def _elsewhere(diagnosis: Diagnosis) -> dict[str, list[dict[str, Any]]]:
    """Return for each adopted effect what it brings on designs that it was not fitted to."""
    problem = diagnosis.problem
    label = problem.design
    return {
        name: [
            {"design": word, "rows": int(np.sum(label.label == k)), "gain_nats": round(by[word], 1)}
            for k, word in enumerate(label.names)
            if word in by
        ]
        for name, by in diagnosis.judged.elsewhere.items()
    }


def _entry(diagnosis: Diagnosis, name: str, before: float, after: float) -> dict[str, Any]:
    """Return what every effect's entry says, 3D rms [m] on rows left out where it is known."""
    effect = effect_of(name)
    known = bool(np.isfinite(before) and np.isfinite(after) and before > 0)
    return {
        "name": name,
        "title": effect.title,
        "of": "arm" if effect.is_arms else "instrument",
        "probability": _probability(diagnosis, name),
        "adopted": name in diagnosis.adopted,
        "rms_before_mm": _mm(before) if known else None,
        "rms_after_mm": _mm(after) if known else None,
        "shrinkage": round(1.0 - after / before, 4) if known else None,
    }


def _candidate(diagnosis: Diagnosis, name: str, before: float, after: float) -> dict[str, Any]:
    return _entry(diagnosis, name, before, after) | {
        "shrinkage_ci": None,
        "parameters": {},
        "interval_90": None,
        "confounded_with": sorted(n.name for n in diagnosis.judged.adopted if name in n.confounded),
        "reason": diagnosis.judged.reasons.get(name, "the rows do not call for it"),
    }


def _probability(diagnosis: Diagnosis, name: str) -> float:
    """Return the probability of a name: of its sets, and no surer than the gates let it be."""
    if name not in diagnosis.adopted:
        value = diagnosis.judged.inclusion.get(name, 0.0)
        return round(min(max(value, 0.0), 0.49), 4)
    own = diagnosis.name(name)
    most = SUREST if diagnosis.verdict == "explained" else DOUBTED
    if own.confounded or own.rival or own.is_half:
        most = EVEN
    return round(min(max(own.probability, 0.0), most), 4)


def _total_shrinkage(diagnosis: Diagnosis, accepted: Collection[str]) -> dict[str, Any]:
    before, after, low, high = diagnosis.total
    if diagnosis.withheld() and not diagnosis.withheld(accepted):
        last = diagnosis.steps[-1]
        after, (low, high) = last.after, last.interval
    sealed = [_mm(v) for v in diagnosis.sealed] if np.all(np.isfinite(diagnosis.sealed)) else None
    return {
        "rms_before_mm": _mm(before),
        "rms_after_mm": _mm(after),
        "value": round(1.0 - after / max(before, 1e-12), 4),
        "ci": [round(low, 4), round(high, 4)],
        "sealed_mm": sealed,
        "with_outliers_mm": [_mm(v) for v in diagnosis.with_faults],
    }


def plain(value: Any) -> Any:  # noqa: ANN401 - a tree of numbers
    """Return a tree of plain JSON values; what is not finite becomes null."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.7g}") if np.isfinite(value) else None
    return value


def _mm(metres: float) -> float:
    return round(metres / MM, 5)


_SHARE = 0.95
_ROUNDING = 1e-9
_LEAST_LEFT = 0.25
"""Share of the squared misses of rows left out that is never put down to the numbers alone."""


def reach_of(diagnosis: Diagnosis) -> Reach:
    """Return what a diagnosis says of its own doubt.

    The radius is that which holds 95 % of the rows, each missed by fits without its place and its
    time (Vovk 2005, conformal prediction): whatever the form of what is left. Readings of one pose
    share one vote (Dunn et al. 2022, hierarchical conformal prediction); where the poses are too
    few for a quantile, the largest ratio is widened as Student has it.
    """
    from scipy.special import ndtri, stdtrit

    problem, kept = diagnosis.problem, diagnosis.kept
    samples = problem.samples.rows(np.flatnonzero(kept))
    pose = Reach.poses(samples.q)
    vote = 1.0 / np.bincount(pose)[pose]
    poses = int(pose.max()) + 1
    missed = diagnosis.held[:, 1]
    spread = spread_of(diagnosis.spread, samples, diagnosis.fit.states, problem.settings)
    square = float(np.average(missed**2, weights=vote))
    known = float(np.average(spread**2, weights=vote))
    left = float(np.sqrt(max(square - known, _LEAST_LEFT * square)))
    ratio = missed / np.hypot(left, spread)
    order = np.argsort(ratio, kind="stable")
    holds = np.cumsum(vote[order]) >= _SHARE * (poses + 1) - _ROUNDING
    factor = float(ratio[order][np.argmax(holds) if holds.any() else -1])
    if not holds.any():
        factor *= float(stdtrit(max(poses - 1, 1), 0.5 + 0.5 * _SHARE) / ndtri(0.5 + 0.5 * _SHARE))
    wrench = samples.wrench
    force = 0.0 if wrench is None else float(np.linalg.norm(wrench[:, :3], axis=1).max())
    return Reach.around(samples.q, force, left, factor, diagnosis.spread, diagnosis.total[0])
