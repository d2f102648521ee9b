"""What an identification says, as data: the ``postproc.identify/1`` document."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from postproc.geometry import kuka_from_transform
from postproc.stiffness.identify.constant import BOUNDS
from postproc.stiffness.identify.identify import Identification
from postproc.stiffness.identify.models import ModelScore
from postproc.stiffness.identify.observability import Visibility, shown_text
from postproc.units import MM, NMM_PER_RAD

SCHEMA = "postproc.identify/1"


def identify_document(result: Identification) -> dict[str, Any]:
    """Return the JSON object; a number that the data cannot give is null."""
    cases = result.cases
    floor = cases.floor
    return {
        "schema": SCHEMA,
        "method": result.chosen,
        "reason": result.reason,
        "rows": cases.readings.get("rows", len(cases)),
        "postures": cases.readings.get("postures", len(cases)),
        "load_responses": len(cases),
        "paired": cases.paired,
        "rows_without_use": cases.dropped,
        "outliers": list(result.outliers),
        "deflection_mm": {"mean": _mm(result.deflection_mean), "max": _mm(result.deflection_max)},
        "noise_mm": _mm(result.noise),
        "noise_from": "repeated readings" if floor and floor.dof >= 12 else "residual",
        "floor_mean_mm": _mm(result.floor_mean),
        "confidence": result.constant.confidence,
        "condition": _number(result.constant.observability.condition),
        "joints": [_joint(result, joint) for joint in range(6)],
        "models": [_score(score) for score in result.scores],
        "cells": _cells(result),
        "registration": _registration(result),
        "remarks": [remark.entry() for remark in result.remarks],
        "warnings": warnings(result),
    }


def warnings(result: Identification) -> list[str]:
    """Return what a user should know before relying on the numbers."""
    found = [remark.line() for remark in result.remarks]
    seen = result.constant.observability
    for joint, estimate in enumerate(result.joints):
        shown = shown_text(result.shown_by.get(joint))
        tail = f"; would be shown by {shown}" if shown else ""
        if estimate.grade is Visibility.UNOBSERVABLE and joint in result.constant.at_bound:
            found.append(
                f"A{joint + 1} is left out: no physical stiffness fits, the data put it "
                f"beyond {BOUNDS[0]:g} to {BOUNDS[1]:g} times the expected compliance"
            )
        elif estimate.grade is Visibility.UNOBSERVABLE:
            twin = seen.confounded.get(joint)
            why = f", it moves the tool like A{twin + 1}" if twin is not None else ""
            found.append(f"A{joint + 1} cannot be measured under these loads{why}: left out{tail}")
        elif seen.visibility[joint] is Visibility.UNOBSERVABLE:
            found.append(f"A{joint + 1} varies too much for one constant; the chosen model has it")
        elif estimate.grade is Visibility.WEAK:
            found.append(f"A{joint + 1} is weak: its motion is near or under the noise{tail}")
    if not result.cases.paired:
        found.append(
            "no posture was read under two loads: geometry errors of the arm go into the stiffness"
        )
    if result.outliers:
        found.append(f"{len(result.outliers)} readings are left out as measuring faults")
    best = min(score.held_out_mean for score in result.scores)
    if best > 1.5 * result.floor_mean:
        found.append(
            f"the best model leaves {best / MM:.3f} mm, noise alone would leave "
            f"{result.floor_mean / MM:.3f} mm: try --method auto, and postproc diagnose for what "
            "else moves the tool"
        )
    return found


def _joint(result: Identification, joint: int) -> dict[str, Any]:
    k_here = result.field.stiffness(result.cases.q, result.cases.point)[:, joint]
    known = bool(result.field.observed[joint])
    spread = np.percentile(k_here, [5, 95]) if known else np.full(2, np.nan)
    one = result.joints[joint]
    return {
        "joint": joint + 1,
        "status": str(one.grade),
        "stiffness_Nmm_per_rad": _number(one.stiffness / NMM_PER_RAD),
        "stiffness_ci_Nmm_per_rad": [_number(v / NMM_PER_RAD) for v in (one.low, one.high)],
        "stiffness_range_Nmm_per_rad": [_number(v / NMM_PER_RAD) for v in spread],
        "relative_sd": _number(one.relative_sd),
        "motion_mm": _mm(result.constant.observability.motion[joint]),
        "shown_by": shown_text(result.shown_by.get(joint)),
    }


def _score(score: ModelScore) -> dict[str, Any]:
    return {
        "name": score.name,
        "description": score.text,
        "held_out_mean_mm": _mm(score.held_out_mean),
        "held_out_p95_mm": _mm(score.held_out_p95),
        "held_out_max_mm": _mm(score.held_out_max),
        "standard_error_mm": _mm(score.standard_error),
        "fitted_mean_mm": _mm(score.fitted_mean),
        "fitted_max_mm": _mm(score.fitted_max),
    }


def _cells(result: Identification) -> list[dict[str, Any]]:
    fit = result.grids.get(result.chosen)
    if fit is None:
        return []
    grid = fit.field.grid
    k = 1.0 / fit.field.c_joint
    relative = fit.sd / fit.field.c_joint
    return [
        {
            "min_mm": [round(float(v) / MM, 6) for v in low],
            "max_mm": [round(float(v) / MM, 6) for v in low + grid.size],
            "n": int(fit.count[number]),
            "stiffness_Nmm_per_rad": [_number(v / NMM_PER_RAD) for v in k[number]],
            "relative_sd": [_number(v) for v in relative[number]],
        }
        for number, low in enumerate(grid.lowest)
    ]


def _registration(result: Identification) -> dict[str, Any] | None:
    found = result.registration
    if found is None:
        return None
    xyz, abc = kuka_from_transform(found.T_measured_robroot)
    return {
        "robroot_xyz_mm": np.round(xyz, 6).tolist(),
        "robroot_abc_deg": np.round(abc, 9).tolist(),
        "point_in_flange_mm": np.round(found.p_flange_point / MM, 6).tolist(),
        "rms_mm": _mm(found.rms),
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _mm(value: float) -> float | None:
    return round(float(value) / MM, 7) if math.isfinite(value) else None
