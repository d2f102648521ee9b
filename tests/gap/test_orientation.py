"""Measured orientations tell by themselves whether what was adopted is right."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.document import document
from postproc.gap.answers.summary import summary
from postproc.gap.fit.problem import pose_problem
from postproc.geometry.frames import apply, rotation_from_abc, transform
from postproc.measurement.file import read_measurements

TARGET = np.radians([30.0, -10.0, 80.0])
NOISE = np.radians(0.002)
OFFSETS = np.radians([0.0, 0.03, -0.02, 0.05, 0.04, 0.0])


def euler(R):
    """KUKA A, B, C by the definition Rz(A) Ry(B) Rx(C)."""
    return np.column_stack(
        [
            np.arctan2(R[:, 1, 0], R[:, 0, 0]),
            np.arcsin(np.clip(-R[:, 2, 0], -1.0, 1.0)),
            np.arctan2(R[:, 2, 1], R[:, 2, 2]),
        ]
    )


@pytest.fixture
def rows(world, tmp_path):
    def make(move):
        rng = np.random.default_rng(7)
        truth = world.Truth(offsets=OFFSETS)
        data = world.campaign(rng, 150, 20)
        points = world.solve(truth, data) + rng.normal(0.0, 1.5e-5, (150, 3))
        R = world.chain(truth, data["q"] + OFFSETS)[6][0] @ world.R_FLANGE
        shaken = rotation_from_abc(rng.normal(0.0, NOISE, (150, 3)))
        R = move[:3, :3] @ R @ rotation_from_abc(TARGET) @ shaken
        lines = world.csv(data, apply(move, points)).splitlines()
        lines[0] += ",a_deg,b_deg,c_deg"
        for k, abc in enumerate(np.degrees(euler(R))):
            lines[k + 1] += "".join(f",{v:.6f}" for v in abc)
        path = tmp_path / "rows.csv"
        path.write_text("\n".join(lines))
        return read_measurements(path)

    return make


@pytest.mark.parametrize("registered", [False, True])
def test_orientations_come_nearer_by_what_is_right(rows, kinematics, cell, registered):
    away = transform(rotation_from_abc(np.array([1.0, 0.2, -0.4])), np.array([4.0, 1.0, -2.0]))
    measured = rows(away if registered else np.eye(4))
    diagnosis = diagnose(pose_problem(measured, kinematics, cell, None, registered))
    assert diagnosis.adopted == ("joint_offset",)
    content = document(diagnosis)
    found = content["orientation"]
    noise = np.degrees(3.0**0.5 * NOISE)
    assert found["rows"] == int(diagnosis.kept.sum())
    assert found["rms_before_deg"] > 0.02
    # the last joint's offset and, registered, the first one's cannot be told from frames
    assert found["rms_after_deg"] == pytest.approx(noise, rel=0.35)
    np.testing.assert_allclose(found["tool_abc_deg"], np.degrees(TARGET), atol=0.05)
    assert any("orientations" in line for line in summary(content))


def test_without_orientations_nothing_is_said(world, kinematics, cell, tmp_path):
    data, points, *_ = world.make(8, {}, n=40)
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, points))
    diagnosis = diagnose(pose_problem(read_measurements(path), kinematics, cell))
    assert document(diagnosis)["orientation"] is None
