"""Campaigns of an arm whose truth is known, read by one or two numbers a row."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.document import model_file
from postproc.gap.answers.predict import predict
from postproc.gap.fit.problem import pose_problem
from postproc.jobs.readings import readings
from postproc.measurement.file import read_measurements

NOISE, POST = 2e-5, np.array([1.5, -2.0, 0.4])
COLUMNS = "x_mm,y_mm,z_mm,u_mm,ux,uy,uz,length_mm,from_x_mm,from_y_mm,from_z_mm,sigma_mm,from_id"


def cells(form, point, rng):
    """Return what one row reads of a point [mm], each form with the same noise."""
    noise, out = rng.normal(0.0, 1e3 * NOISE, 3), [""] * 13
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    if form in ("points", "plane"):
        count = 3 if form == "points" else 2
        out[:count] = [f"{v:.6f}" for v in (point + noise)[:count]]
    if form == "gauge":
        out[3:7] = [f"{point @ way + noise[0]:.6f}", *(f"{v:.9f}" for v in way)]
    if form == "wire":
        length = np.linalg.norm(point - 1e3 * POST) + noise[0]
        out[7:11] = [f"{length:.6f}", *(f"{1e3 * v:.3f}" for v in POST)]
    if form == "unknown":
        length = np.linalg.norm(point - 1e3 * POST) + noise[0]
        out[7], out[12] = f"{length:.6f}", "post"
    out[11] = f"{1e3 * NOISE:g}"
    return out


def written(world, folder, forms, cause, n):
    """Return a file of rows whose readings take turns, and the rows of a fresh campaign."""
    rng = np.random.default_rng(3)
    data, _, fresh, points = world.make(52, cause, n=n, noise=0.0)
    truth = world.make(52, cause, n=n, noise=0.0)[1]
    lines = world.csv(data, truth).splitlines()
    names = lines[0].split(",")
    kept = [k for k, name in enumerate(names) if name not in ("x_mm", "y_mm", "z_mm")]
    rows = [",".join([*(names[k] for k in kept), COLUMNS])]
    for k, (line, point) in enumerate(zip(lines[1:], 1e3 * truth, strict=True)):
        own = [line.split(",")[k] for k in kept]
        rows.append(",".join([*own, *cells(forms[k % len(forms)], point, rng)]))
    path = folder / "rows.csv"
    path.write_text("\n".join(rows) + "\n")
    (folder / "fresh.csv").write_text(world.csv(fresh, points))
    return path, read_measurements(folder / "fresh.csv")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("forms", "cause"),
    [
        (("gauge",), {"backlash": 3e-4}),
        (("wire", "points"), {"joint_compliance": 3e-4}),
        (("plane", "gauge", "wire"), {"thermal_drift": 3e-4}),
        (("unknown",), {"backlash": 3e-4}),
    ],
)
def test_a_cause_is_named_from_readings_of_any_form(
    forms, cause, world, cell, kinematics, tmp_path
):
    path, fresh = written(world, tmp_path, forms, cause, 260)
    rows = readings([path], kinematics, cell, any_reading=True)
    assert len(rows) == 260
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert set(diagnosis.adopted) == set(cause)
    assert diagnosis.verdict == "explained"
    got = predict(fresh, kinematics, cell, model_file(diagnosis, None))
    before = predict(fresh, kinematics, cell)
    off = [np.sqrt(np.mean(np.sum((p.points - fresh.position) ** 2, 1))) for p in (before, got)]
    assert off[1] < 0.2 * off[0]
