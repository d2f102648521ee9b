"""``import postproc``: the names that stay, and the way of a user from a file to a program."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import postproc as pp
from tests.kinematics.test_forward import pinocchio_arm

ROOT = Path(__file__).resolve().parents[2]
CASE = ROOT / "fixtures" / "drilling_panel"
NAMES = [
    "BaseJob",
    "BatchOutcome",
    "Cell",
    "CellCheck",
    "CellDraft",
    "DiagnosisJob",
    "DiffReport",
    "Entry",
    "Finding",
    "IdentifyJob",
    "Inspection",
    "Job",
    "MeasuringPlan",
    "ModelFile",
    "PlaceJob",
    "PostprocError",
    "Prediction",
    "Severity",
    "SpinStiffness",
    "ToolPath",
    "VerifyReport",
    "__version__",
    "batch",
    "check",
    "convert",
    "diagnose",
    "diff",
    "explain",
    "fit_base",
    "holes",
    "identify",
    "inspect",
    "lint",
    "load_cell",
    "load_model",
    "new_cell",
    "place",
    "predict",
    "read",
    "robots",
    "sample",
    "stiffness",
    "verify",
]


@pytest.fixture(scope="module")
def cell():
    return pp.load_cell(CASE / "cell.toml")


@pytest.fixture(scope="module")
def holes(tmp_path_factory):
    """The first row of the panel."""
    lines = (CASE / "panel.csv").read_text(encoding="utf-8").splitlines()[:13]
    path = tmp_path_factory.mktemp("api") / "row.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def job(cell, holes):
    return pp.convert(pp.read(holes, cell), cell)


def test_the_public_names_are_these():
    assert pp.__all__ == NAMES
    assert dir(pp) == sorted(NAMES)
    for name in NAMES:
        assert getattr(pp, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = pp.no_such_name


def test_importing_the_package_loads_nothing_heavy():
    code = "import sys, postproc; print(sorted({'numpy', 'pinocchio', 'click'} & set(sys.modules)))"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "[]"


def test_a_job_has_tables_with_units_in_their_names(job, holes):
    assert job.good
    rows = np.genfromtxt(holes, delimiter=",", names=True, dtype=None, encoding="utf-8")
    for name in ("x", "y", "z"):
        np.testing.assert_allclose(job.tags[f"{name}_mm"], rows[name], atol=1e-9)
    assert list(job.tags["id"]) == list(rows["id"])
    assert set(job.tags["kind"]) == {"hole"}
    assert len(job.points) == len(job.plan)
    with pytest.raises(ValueError, match="read-only"):
        job.tags["x_mm"][0] = 0.0


def test_joints_of_the_points_put_the_tool_where_the_points_say(job, cell):
    """Forward kinematics by pinocchio, frames by the definition of KUKA's A, B, C."""
    model, flange = pinocchio_arm(cell.robot.geometry)
    data = model.createData()
    q = np.deg2rad(np.stack([job.points[f"q{k}_deg"] for k in range(1, 7)], axis=1))
    xyz = np.stack([job.points[name] for name in ("x_mm", "y_mm", "z_mm")], axis=1)
    for row in range(0, len(q), 7):
        pinocchio.framesForwardKinematics(model, data, q[row])
        T_robroot_flange = data.oMf[flange].homogeneous
        T = np.linalg.inv(cell.T_robroot_base) @ T_robroot_flange @ cell.tool.T_flange_tcp
        np.testing.assert_allclose(T[:3, 3] * 1e3, xyz[row], atol=1e-3)
        a, b, c = (np.deg2rad(job.points[name][row]) for name in ("a_deg", "b_deg", "c_deg"))
        Rz, Ry, Rx = (pinocchio.utils.rotate(u, v) for u, v in zip("zyx", (a, b, c), strict=True))
        np.testing.assert_allclose(T[:3, :3], Rz @ Ry @ Rx, atol=1e-6)


def test_what_is_written_verifies_and_equals_the_command_line(job, cell, holes, tmp_path):
    paths = job.write(tmp_path / "api")
    assert {path.name for path in paths} == set(job.files)
    report = pp.verify(tmp_path / "api" / f"{job.name}.src", cell, against=holes)
    assert report.ok
    assert report.position_error < 1e-5
    assert not [f for f in pp.lint(tmp_path / "api" / f"{job.name}.src") if f.severity == "error"]
    command = [sys.executable, "-m", "postproc", "convert", str(holes), "--json"]
    command += ["--cell", str(CASE / "cell.toml"), "-o", str(tmp_path / "cli")]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    for name, content in job.files.items():
        assert (tmp_path / "cli" / name).read_bytes() == content
    told = json.loads(answer.stdout)
    assert {k: v for k, v in told.items() if k not in ("timing_s", "removed")} == {
        k: v for k, v in job.document.items() if k != "timing_s"
    }
    assert pp.diff(tmp_path / "api", tmp_path / "cli").same


def test_a_tag_out_of_reach_is_a_finding_and_no_program(cell, tmp_path):
    path = tmp_path / "far.csv"
    path.write_text("id,x,y,z,i,j,k,depth,feed\nfar,9000,0,0,0,0,1,5,100\n", encoding="utf-8")
    job = pp.convert(path, cell)
    assert not job.good
    assert not job.files
    assert job.document["failures"][0]["reason"] == "unreachable"
    assert repr(job).endswith("errors: 1>")


def test_wrong_input_raises_one_kind_of_error(cell, tmp_path):
    with pytest.raises(pp.PostprocError, match="IO001"):
        pp.read(tmp_path / "none.csv", cell)
    with pytest.raises(pp.PostprocError):
        pp.load_cell(tmp_path / "none.toml")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, "0.01"])
@pytest.mark.parametrize("name", ["tol_mm", "tol_deg"])
def test_a_tolerance_that_is_no_number_turns_no_check_off(cell, tmp_path, name, value):
    for zero in (value, 0.0):
        with pytest.raises(pp.PostprocError, match="VER003"):
            pp.verify(tmp_path / "none.src", cell, **{name: zero})
    with pytest.raises(pp.PostprocError, match="VER003"):
        pp.diff(tmp_path, tmp_path, **{name: value})


@pytest.mark.parametrize(
    "options",
    [
        {"grid_mm": float("nan")},
        {"grid_mm": float("inf")},
        {"origin_mm": [0.0, float("nan"), 0.0]},
        {"confidence": float("nan")},
        {"confidence": 1.0},
    ],
)
def test_numbers_of_identify_are_to_be_reckoned_with(cell, tmp_path, options):
    with pytest.raises(pp.PostprocError, match=r"STF02[68]"):
        pp.identify(tmp_path / "none.csv", cell, **options)


def test_representations_are_short_and_escape_html(job):
    assert repr(job) == f"<Job {job.name}: 12 tags, {len(job.plan)} motions, good>"
    assert "<table>" in job._repr_html_()
    assert job.page().startswith(b"<!doctype html>")
