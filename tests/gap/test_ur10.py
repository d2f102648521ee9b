"""A real robot: fitted on one series of poses, judged on the other."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.document import model_file
from postproc.gap.answers.predict import predict
from postproc.gap.fit.problem import pose_problem
from postproc.kinematics import build
from postproc.measurement.file import read_measurements
from tests.places import SHARED
from tools.dev.real_arms import UR10_CELL

REAL = SHARED / "real" / "ur10"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.corpus,
    pytest.mark.skipif(not REAL.is_dir(), reason="no corpus"),
]


_RANDOM, _GRID = "series_C_random", "series_A_grid"


@pytest.mark.parametrize(
    ("fitted", "judged", "sigma_mm"),
    [(_RANDOM, _GRID, None), (_GRID, _RANDOM, 0.03)],
)
def test_the_diagnosis_holds_on_poses_of_another_kind(tmp_path, fitted, judged, sigma_mm):
    """What the instrument is said to scatter by says nothing of the arm, and changes no cause."""
    shutil.copy(REAL / "ur10.urdf", tmp_path)
    stated = "" if sigma_mm is None else f"[measuring]\nsigma_mm = {sigma_mm}\n"
    (tmp_path / "cell.toml").write_text(UR10_CELL + stated)
    cell = load_cell(tmp_path / "cell.toml")
    kinematics = build(cell.robot)
    rows, others = (read_measurements(REAL / f"{name}.csv") for name in (fitted, judged))
    diagnosis = diagnose(pose_problem(rows, kinematics, cell, None, True))
    assert diagnosis.verdict == ("undetermined" if sigma_mm is None else "unexplained")
    assert "backlash" not in diagnosis.adopted
    assert not {"base_frame", "tool_frame"} & set(diagnosis.adopted)
    held = {*diagnosis.adopted, *diagnosis.serving}
    assert {"link_geometry", "angle_error"} <= set(diagnosis.adopted)
    assert {"link_geometry", "gravity_sag", "angle_error"} <= held
    assert diagnosis.total[1] < 0.16 * diagnosis.total[0]
    model = model_file(diagnosis, None)
    rms = []
    for known in (None, model):
        got = predict(others, kinematics, cell, known, True)
        rms.append(np.sqrt(np.mean(np.sum((got.points - others.position) ** 2, axis=1))) * 1e3)
    assert rms[1] < 0.47
    assert rms[1] < 0.7 * rms[0]
