"""The commands as a user calls them: plan, fill in, identify, look at stiffness."""

import csv
import io
import json

import numpy as np
import pytest

from postproc.cli.app import run
from postproc.model.modelfile import load_model
from tools.dev.hidden_twin import Twin

from .conftest import WEIGHT

BOX = ["--box", "1500", "-600", "500", "2100", "600", "1100"]


def filled(path, twin, sigma=12e-6):
    """Fill in a plan's CSV with what the hidden robot would be read at."""
    lines = path.read_text(encoding="utf-8").splitlines()
    remarks = [line for line in lines if line.startswith("#")]
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    q = np.radians([[float(row[f"q{i}_deg"]) for i in range(1, 7)] for row in rows])
    loaded = np.array([row["load"] == "50kg" for row in rows])
    at = np.array([0.0535, 0.0, 0.362])
    points = np.where(loaded[:, None], twin.loaded_point(q, WEIGHT, at), twin.point(q))
    points = points + np.random.default_rng(0).normal(size=points.shape) * sigma
    out = io.StringIO()
    writer = csv.DictWriter(out, rows[0].keys(), lineterminator="\n")
    writer.writeheader()
    for row, point in zip(rows, points * 1e3, strict=True):
        writer.writerow(
            row | {n: f"{v:.4f}" for n, v in zip(("x_mm", "y_mm", "z_mm"), point, strict=True)}
        )
    target = path.with_name("filled.csv")
    target.write_text("\n".join(remarks) + "\n" + out.getvalue(), encoding="utf-8")
    return target


@pytest.fixture(scope="module")
def planned(cell_path, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    code = run(
        ["sample", "--cell", str(cell_path), *BOX, "--grid", "300", "-o", str(folder), "-q",
         "--method", "optimal", "--count", "48", "--load-at", "53.5", "0", "362"]
    )  # fmt: skip
    assert code == 0
    return folder


def test_plan_writes_its_files_and_the_same_again(planned, cell_path, tmp_path, capsys):
    names = {"sample.csv", "sample.src", "sample.dat", "sample.html"}
    assert {p.name for p in planned.iterdir()} == names
    call = ["sample", "--cell", str(cell_path), *BOX, "--grid", "300", "-o", str(tmp_path)]
    call += ["--method", "optimal", "--count", "48", "--load-at", "53.5", "0", "362", "--json"]
    assert run(call) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["postures"] == 48
    assert content["readings"] == 96
    assert content["joints"][0]["status"] == "unobservable"
    for name in names:
        assert (tmp_path / name).read_bytes() == (planned / name).read_bytes()


def test_page_is_one_file_without_requests(planned):
    text = (planned / "sample.html").read_text(encoding="utf-8")
    assert "data-chart" in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text


def test_identify_from_the_filled_plan(planned, cell_path, tmp_path, capsys):
    measured = filled(planned / "sample.csv", Twin(0, 0.55))
    model, page = tmp_path / "model.toml", tmp_path / "page.html"
    code = run(
        ["identify", str(measured), "--cell", str(cell_path), "-o", str(model), "--json",
         "--report", str(page)]
    )  # fmt: skip
    captured = capsys.readouterr()
    content = json.loads(captured.out)
    assert code == 0
    assert content["method"] == "continuous"
    assert content["joints"][0]["stiffness_Nmm_per_rad"] is None
    assert "A1 cannot be measured" in captured.err
    assert set(load_model(model).effects) == {"joint_compliance", "variable_stiffness"}
    assert "Stiffness over each joint" in page.read_text(encoding="utf-8")


def test_grid_as_the_contract_names_it(planned, cell_path, tmp_path, capsys):
    measured = filled(planned / "sample.csv", Twin(0, 0.55))
    model = tmp_path / "model.toml"
    assert run(["identify", str(measured), "--cell", str(cell_path), "-o", str(model),
                "--grid", "600"]) == 0  # fmt: skip
    assert load_model(model).effects["variable_stiffness"]["kind"] == "grid"
    assert "grid 600" in capsys.readouterr().out


def test_an_unfilled_plan_is_refused_with_its_line(planned, cell_path, tmp_path, capsys):
    target = tmp_path / "model.toml"
    code = run(
        ["identify", str(planned / "sample.csv"), "--cell", str(cell_path), "-o", str(target)]
    )
    assert code == 2
    first = capsys.readouterr().err.splitlines()[0]
    assert "sample.csv:5: error MEA007: the row reads nothing" in first
    assert not target.exists()


@pytest.mark.parametrize(
    ("more", "code"),
    [
        (["--grid", "-5"], "STF026"),
        (["--method", "grid"], "STF026"),
        (["--confidence", "2"], "STF028"),
    ],
)
def test_wrong_calls_say_what_was_expected(planned, cell_path, tmp_path, capsys, more, code):
    measured = filled(planned / "sample.csv", Twin())
    call = ["identify", str(measured), "--cell", str(cell_path), "-o", str(tmp_path / "m.toml")]
    assert run(call + more) == 2
    assert code in capsys.readouterr().err


@pytest.fixture(scope="module")
def holes(tmp_path_factory):
    path = tmp_path_factory.mktemp("cam") / "holes.csv"
    rows = [f"{x},{y},150,-1,0,0" for y in (-400, 0, 400) for x in (50, 250)]
    path.write_text("x,y,z,i,j,k\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_stiffness_over_the_rotation(holes, cell_path, tmp_path, capsys):
    page = tmp_path / "page.html"
    code = run(["stiffness", str(holes), "--cell", str(cell_path), "-o", str(page), "--json"])
    content = json.loads(capsys.readouterr().out)
    assert code == 0
    assert not content["coaxial"]
    assert len(content["spins_deg"]) == 36
    for tag in content["tags"]:
        axial = [v for v in tag["N_per_mm"]["axial"] if v is not None]
        assert tag["best"]["axial"]["N_per_mm"] == pytest.approx(max(axial))
        assert max(axial) > 1.05 * min(axial)
    assert "ellipsoid_kv" in page.read_text(encoding="utf-8")


def test_a_coaxial_tool_gains_nothing_by_turning(holes, cell_path, tmp_path, capsys):
    text = cell_path.read_text(encoding="utf-8")
    text = text.replace("xyz_mm = [107, 0, 362], abc_deg = [0, 0, 180]",
                        "xyz_mm = [0, 0, 362], abc_deg = [0, -90, 0]")  # fmt: skip
    own = tmp_path / "coaxial.toml"
    own.write_text(text, encoding="utf-8")
    run(["stiffness", str(holes), "--cell", str(own), "--json"])
    captured = capsys.readouterr()
    content = json.loads(captured.out)
    assert content["coaxial"]
    assert "spin does not change the stiffness" in captured.err
    for tag in content["tags"]:
        values = [v for v in tag["N_per_mm"]["axial"] if v is not None]
        if values:
            assert max(values) == pytest.approx(min(values), rel=1e-6)


def test_stiffness_follows_the_model(holes, cell_path, tmp_path, capsys):
    model = tmp_path / "soft.toml"
    model.write_text(
        'schema = "postproc.model/1"\n[effects.joint_compliance]\n'
        "stiffness_Nmm_per_rad = [0.79e10, 3.06e9, 2.64e9, 2.33e8, 1.095e8, 1.745e8]\n",
        encoding="utf-8",
    )
    best = []
    for more in ([], ["--model", str(model)]):
        assert run(["stiffness", str(holes), "--cell", str(cell_path), "--json", *more]) == 0
        best.append(json.loads(capsys.readouterr().out)["tags"][0]["best"]["axial"]["N_per_mm"])
    assert best[1] == pytest.approx(0.5 * best[0])


def test_unknown_tags_are_named(holes, cell_path, capsys):
    assert run(["stiffness", str(holes), "--cell", str(cell_path), "--tags", "0,nine"]) == 2
    assert "'nine'" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["sample", "identify", "stiffness"])
def test_help_has_an_example(name, capsys):
    assert run([name, "--help"]) == 0
    assert f"postproc {name}" in capsys.readouterr().out
