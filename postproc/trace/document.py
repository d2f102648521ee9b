"""The answer as a document (``postproc.pathdiagnosis/1``), as a model file, and in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.model import ModelFile
from postproc.trace.answer import PathDiagnosis, Proof
from postproc.trace.classes import unexplained
from postproc.trace.effect import PATH_EFFECTS, PROGRAM
from postproc.trace.evidence import Verdict
from postproc.trace.iso import figures
from postproc.trace.phases import NAMES
from postproc.trace.planner import PLANNER, Planned
from postproc.trace.torque import torques
from postproc.units import MM

SCHEMA = "postproc.pathdiagnosis/1"
WORST_LINES = 50
REST = "path_rest"
"""Table of a model file for what the named effects leave off the path."""


def document(found: PathDiagnosis) -> dict[str, Any]:
    """Return the document."""
    size = np.linalg.norm(found.gap, axis=1)
    left = np.linalg.norm(found.rest, axis=1)
    worst = found.contour
    total = float(np.sum(size**2))
    return {
        "schema": SCHEMA,
        "verdict": found.verdict,
        "rows": {"read": found.recording.rows_read, "used": len(found.recording)},
        "gap": _levels(size),
        "contour": {**_levels(worst), "left_rms_mm": _mm(_rms(found.contour_left))},
        "noise": {
            "sigma_mm": _mm(found.sigma),
            "source": "rows",
            "memory_mm": _mm(found.slow(found.rest)),
        },
        "where": {
            "phases": _phases(found, size, left, worst, total),
            "lines": _lines(found, size, worst),
            "joints": _joints(found),
        },
        "iso9283": figures(found.scene, found.scene.points + found.gap, found.match),
        "effects": _effects(found),
        "adopted": list(found.adopted),
        "residual": {"rms_mm": _mm(_rms(left)), "explained_share": _share(left, total)},
        "unexplained": unexplained(found),
        **({} if (torque := torques(found)) is None else {"torque": torque}),
        "not_testable": _not_testable(found),
        "known": sorted({*found.known, *found.known_of_planner}),
        "remarks": list(found.recording.remarks),
    }


def _mm(value: float) -> float:
    return float(np.round(value / MM, 7))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def _share(left: FloatArray, total: float) -> float:
    return float(np.round(1.0 - np.sum(left**2) / total, 5)) if total > 0.0 else 0.0


def _levels(size: FloatArray) -> dict[str, float]:
    return {
        "rms_mm": _mm(_rms(size)),
        "p95_mm": _mm(float(np.quantile(size, 0.95))),
        "max_mm": _mm(float(size.max())),
    }


def _phases(
    found: PathDiagnosis, size: FloatArray, left: FloatArray, contour: FloatArray, total: float
) -> list[dict[str, Any]]:
    phase = found.scene.phases.phase
    rows = []
    for number, name in enumerate(NAMES):
        mine: BoolArray = phase == number
        if mine.any():
            share = float(np.sum(size[mine] ** 2)) / total if total > 0.0 else 0.0
            rows.append(
                {
                    "phase": name,
                    "share": round(share, 5),
                    "rms_mm": _mm(_rms(size[mine])),
                    "rows": int(mine.sum()),
                    "contour_rms_mm": _mm(_rms(contour[mine])),
                    "left_rms_mm": _mm(_rms(left[mine])),
                }
            )
    return sorted(rows, key=lambda row: (-row["share"], row["phase"]))


def _lines(found: PathDiagnosis, size: FloatArray, contour: FloatArray) -> list[dict[str, Any]]:
    line = found.recording.line
    if line is None and found.match is not None:
        number = found.match.program.line
        line = np.where(found.match.on, number[np.maximum(found.match.motion, 0)], -1)
    if line is None:
        return []
    numbers, place = np.unique(line, return_inverse=True)
    count = np.bincount(place)
    rms = np.sqrt(np.bincount(place, size**2) / count)
    top, far = np.zeros(len(numbers)), np.zeros(len(numbers))
    np.maximum.at(top, place, size)
    np.maximum.at(far, place, contour)
    order = np.lexsort((numbers, -rms))
    return [
        {
            "line": int(numbers[k]),
            "rms_mm": _mm(float(rms[k])),
            "max_mm": _mm(float(top[k])),
            "contour_max_mm": _mm(float(far[k])),
        }
        for k in order
        if numbers[k] >= 0
    ][:WORST_LINES]


def _joints(found: PathDiagnosis) -> list[dict[str, Any]]:
    """Return the share of the gap that enters at each joint, as far as joints were recorded."""
    first = found.stages[0] if found.stages else None
    if first is None or not first.in_joints:
        return []
    J = found.scene.jacobian
    parts = [J[:, :, k] * first.gap[k][:, None] for k in range(len(first.gap))]
    squares = np.array([float(np.sum(p**2)) for p in parts])
    total = float(squares.sum()) or 1.0
    rows = [{"joint": k + 1, "share": float(np.round(s / total, 5))} for k, s in enumerate(squares)]
    return sorted(rows, key=lambda row: (-row["share"], row["joint"]))


def _effects(found: PathDiagnosis) -> list[dict[str, Any]]:
    proven = {proof.name: proof for proof in found.proofs if proof.stage == PROGRAM}
    rows = [_planned(found, effect, proven[effect.name]) for effect in found.planned]
    for verdict in found.verdicts:
        for proof in found.proofs:
            if proof.stage == verdict.stage.name:
                rows.append(_effect(found, verdict, proof))
    place = {name: k for k, name in enumerate(found.adopted)}

    def key(row: dict[str, Any]) -> tuple[int, float, float, str]:
        name = row["name"]
        return place.get(name, len(place)), -row["probability"], -row["shrinkage"], name

    return sorted(rows, key=key)


def _planned(found: PathDiagnosis, effect: Planned, proof: Proof) -> dict[str, Any]:
    judged_on = "corners not fitted" if effect.is_place else "lines at speed"
    row = _row(proof, effect.probability, effect.parameters, judged_on, PLANNER[effect.name])
    return row | {"adopted": effect.name in found.adopted, "confounded_with": []}


def _row(
    proof: Proof, probability: float, table: dict[str, Any], judged_on: str, words: tuple[str, str]
) -> dict[str, Any]:
    return {
        "name": proof.name,
        "stage": proof.stage,
        "probability": round(probability, 6),
        "rms_before_mm": _mm(proof.before),
        "rms_after_mm": _mm(proof.after),
        "shrinkage": round(proof.shrinkage, 5),
        "shrinkage_ci": [round(end, 5) for end in proof.interval],
        "judged_on": judged_on,
        "parameters": table,
        "title": words[0],
        "action": words[1],
    }


def _effect(found: PathDiagnosis, verdict: Verdict, proof: Proof) -> dict[str, Any]:
    name, effect = proof.name, PATH_EFFECTS.get(proof.name)
    fitted = verdict.fitted if name in verdict.adopted else verdict.with_each[name]
    table = effect.table(verdict.stage, fitted.thetas[name], fitted.deviations[name])
    probability = verdict.probability[name] * proof.outweighs
    row = _row(proof, probability, table, found.withheld_on, (effect.title, effect.action))
    is_adopted = name in found.adopted and name in verdict.adopted
    return row | {"adopted": is_adopted, "confounded_with": list(verdict.twins.get(name, ()))}


def _not_testable(found: PathDiagnosis) -> list[dict[str, Any]]:
    have = {stage.name for stage in found.stages}
    needs = {
        "joints": ["q1_act_deg ... q6_act_deg"],
        "tool": ["x_mm", "y_mm", "z_mm"],
        "program": ["--program or --against"],
    }
    rows: list[dict[str, Any]] = []
    if found.match is None:
        rows = [{"name": name, "needs": needs["program"]} for name in sorted(PLANNER)]
    for name, effect in PATH_EFFECTS:
        if effect.is_cause and not have & set(effect.stages):
            first = next((s for s in effect.stages if s in needs), "tool")
            rows.append({"name": name, "needs": needs[first]})
    return rows


def model_file(found: PathDiagnosis, given: ModelFile | None) -> ModelFile:
    """Return the given model plus what was adopted: of what it had already, both together."""
    effects = {} if given is None else dict(given.effects)
    for name in reversed(found.adopted):
        effects[name] = _whole(found, name, effects.get(name, {}))
    if found.adopted:
        effects[REST] = found.left_off_path
    return replace(given or ModelFile(), effects=effects, text=None)


def _whole(found: PathDiagnosis, name: str, had: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of an effect, known and new; what the rows cannot tell is as it was."""
    if name in found.as_programmed:
        return found.as_programmed[name].parameters
    effect = PATH_EFFECTS.get(name)
    at = [verdict for verdict in found.verdicts if name in verdict.adopted]
    parts = [verdict.fitted.thetas[name] for verdict in at]
    parts += [found.known[name]] if name in found.known else []
    deviation = at[0].fitted.deviations[name]
    table = effect.table(at[0].stage, reduce(effect.joined, parts), deviation)
    return {k: _with(had.get(k), v) for k, v in table.items() if k in effect.keys}


def _with(had: Any, new: Any) -> Any:  # noqa: ANN401 - numbers, texts, lists of them
    """Return a value where it is known, else what there was."""
    if isinstance(new, list):
        return [_with(h, n) for h, n in zip(had or [None] * len(new), new, strict=True)]
    return new if new is not None else float("nan") if had is None else had


def summary(told: dict[str, Any]) -> Sequence[str]:
    """Return the answer in words, line by line."""
    gap, left = told["gap"], told["residual"]
    off = told["contour"]["rms_mm"]
    lines = [
        f"{told['verdict'].replace('_', ' ')}: the tool point is {gap['rms_mm']:.3f} mm (rms) off"
        f" its command, at most {gap['max_mm']:.3f} mm; off the path {off:.3f} mm"
    ]
    for row in told["effects"]:
        if row["adopted"]:
            lines.append(
                f"{row['name']}: {row['title']}; {row['rms_before_mm']:.3f} mm becomes"
                f" {row['rms_after_mm']:.3f} mm on {row['judged_on']}"
            )
    for row in told.get("torque", {}).get("joints", ()):
        if row["saturated_rows"]:
            lines.append(
                f"A{row['joint']} stands at its torque limit in {row['saturated_rows']} rows"
            )
    worst = told["where"]["phases"][:1]
    lines += [f"most of it in the phase {w['phase']} ({w['share']:.0%})" for w in worst]
    if told["verdict"] == "unexplained":
        lines.append(f"{left['rms_mm']:.3f} mm are left and follow no effect of the library")
    return lines
