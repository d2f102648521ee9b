"""What a metrologist signs of a diagnosis: with what, under which conditions, how sure, and where.

Devices, people and dates are those that the user states in ``[measuring]``; nothing is made up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.fit import repeats
from postproc.units import DEG, MM

COVERAGE = 2.0
"""Coverage factor k of every expanded uncertainty."""
FEWEST_CYCLES = 5
"""Readings of one pose, from one side and under one load, from which its repeatability is told;
ISO 9283 asks for 30."""
CYCLES = 30
_BINS = 24


def certificate(diagnosis: Diagnosis, cell: Cell) -> dict[str, Any]:
    """Return the certificate of a diagnosis as an entry of its document.

    Args:
        diagnosis: the answer to a campaign.
        cell: with robot, tool and what is stated of the instrument.
    """
    problem, kept = diagnosis.problem, diagnosis.kept
    away = np.linalg.norm(problem.rest(diagnosis.baseline), axis=1) / MM
    ids, q = problem.measurements.ids, problem.samples.q[kept] / DEG
    points = problem.measured[kept] / MM
    sigma = diagnosis.noise / MM if diagnosis.level.known else None
    return {
        "robot": cell.robot.name,
        "tool": cell.tool.name or str(cell.tool.number),
        "stated": dict(cell.instrument.stated),
        "rows": {
            "total": len(problem),
            "used": int(kept.sum()),
            "not_used": [
                {"id": ids[k], "off_mm": round(float(away[k]), 4)} for k in np.flatnonzero(~kept)
            ],
        },
        "conditions": [
            {"name": name, "from": round(float(v.min()), 3), "to": round(float(v.max()), 3)}
            for name, v in _conditions(diagnosis)
        ],
        "uncertainty": {
            "k": COVERAGE,
            "reading_mm": None if sigma is None else round(COVERAGE * sigma, 4),
            "model_mm": round(COVERAGE * diagnosis.total[1] / MM / 3.0**0.5, 4),
        },
        "validity": {
            "joints_deg": np.round([q.min(axis=0), q.max(axis=0)], 2).T.tolist(),
            "box_mm": np.round([points.min(axis=0), points.max(axis=0)], 1).tolist(),
        },
        "iso9283": _iso9283(diagnosis),
        "held_out": _held_out(diagnosis.held / MM),
    }


def _conditions(diagnosis: Diagnosis) -> Iterator[tuple[str, FloatArray]]:
    """Yield name and values of the logged conditions of the rows used."""
    samples, kept = diagnosis.problem.samples, diagnosis.kept
    if samples.time is not None:
        yield "time [h]", samples.time[kept] / 3600.0
    if samples.temperature is not None:
        yield "temperature of the arm [degC]", samples.temperature[kept]
    if samples.wrench is not None:
        yield "force [N]", np.linalg.norm(samples.wrench[kept, :3], axis=1)
    if samples.qd is not None:
        yield "fastest joint [deg/s]", np.abs(samples.qd[kept]).max(axis=1) / DEG
    for name, values in samples.extra.items():
        if not np.issubdtype(np.asarray(values).dtype, np.number):
            continue
        known = values[kept][np.isfinite(values[kept])]
        if len(known):
            yield name, known


def _iso9283(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return AP, RP and drift of AP (ISO 9283:1998, 7.2 and 7.6) of poses that were read again."""
    problem = diagnosis.problem
    pose = repeats(problem.samples, problem.set_ups.unit)
    time = problem.samples.time
    found, drift = [], 0.0
    for k in np.unique(pose[diagnosis.kept]):
        rows = np.flatnonzero((pose == k) & diagnosis.kept)
        if len(rows) < FEWEST_CYCLES:
            continue
        points = problem.measured[rows] / MM
        centre, command = points.mean(axis=0), diagnosis.baseline[rows[0]] / MM
        apart = np.linalg.norm(points - centre, axis=1)
        accuracy = np.linalg.norm(points - command, axis=1)
        drift = max(drift, float(np.ptp(accuracy)))
        found.append(
            {
                "pose": problem.measurements.ids[rows[0]],
                "readings": len(rows),
                "ap_mm": round(float(np.linalg.norm(centre - command)), 4),
                "rp_mm": round(float(apart.mean() + 3.0 * apart.std(ddof=1)), 4),
            }
        )
    timed = bool(found) and time is not None
    return {
        "poses": found,
        "cycles_asked": CYCLES,
        "drift_ap_mm": round(drift, 4) if timed else None,
    }


def _held_out(held: FloatArray) -> dict[str, Any]:
    """Return rms and histogram of how far rows were missed by fits without them (k, 2) [mm]."""
    edges = np.linspace(0.0, max(float(np.quantile(held, 0.995)), 1e-6), _BINS + 1)
    counts = [np.histogram(np.minimum(v, edges[-1]), edges)[0].tolist() for v in held.T]
    return {
        "rows": len(held),
        "rms_mm": np.round(np.sqrt(np.mean(held**2, axis=0)), 4).tolist(),
        "p95_mm": np.round(np.quantile(held, 0.95, axis=0), 4).tolist(),
        "edges_mm": np.round(edges, 5).tolist(),
        "before": counts[0],
        "after": counts[1],
    }
