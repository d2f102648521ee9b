"""What a script gets is what the command prints: each name of the package against its command."""

import json
from pathlib import Path

import numpy as np
import pytest

import postproc as pp
from postproc.cli.app import run

ROOT = Path(__file__).resolve().parents[2]
CASE = ROOT / "fixtures" / "drilling_panel"
CELL = str(CASE / "cell.toml")
PANEL = CASE / "panel.csv"


def told(capsys, *arguments):
    """Return what a command says with --json."""
    capsys.readouterr()
    run([*map(str, arguments), "--json"])
    return json.loads(capsys.readouterr().out)


def as_json(document):
    return json.loads(json.dumps(document))


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    lines = PANEL.read_text(encoding="utf-8").splitlines()[:7]
    path = tmp_path_factory.mktemp("rows") / "row.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_inspect_check_robots_explain_and_stiffness_say_what_the_commands_say(rows, capsys):
    cell = pp.load_cell(CELL)
    stiff = pp.stiffness(rows, cell, step_deg=30)
    pairs = {
        "inspect": (pp.inspect(rows).document, ("inspect", rows)),
        "inspect by a cell": (
            pp.inspect(rows, cell, units="inch").document,
            ("inspect", rows, "--cell", CELL, "--units", "inch"),
        ),
        "check": (pp.check(cell).document, ("check", CELL)),
        "robot": (
            {"schema": "postproc.robots/1", **pp.robots("KR 210 R2700-2")[0]},
            ("robots", "KR 210 R2700-2"),
        ),
        "robots": (
            {"schema": "postproc.robots/1", "robots": pp.robots(reach_mm=3000, payload_kg=200)},
            ("robots", "--reach", 3000, "--payload", 200),
        ),
        "stiffness": (stiff.document, ("stiffness", rows, "--cell", CELL, "--step", 30)),
    }
    wrong = [
        name for name, (document, call) in pairs.items() if as_json(document) != told(capsys, *call)
    ]
    entry, said = pp.explain("pln101"), told(capsys, "explain", "PLN101")
    assert (entry.code, entry.cause, entry.remedy) == (said["code"], said["cause"], said["remedy"])
    assert wrong == []
    assert stiff.good
    assert stiff.page().startswith(b"<!doctype html>")
    with pytest.raises(pp.PostprocError, match="CLI014"):
        pp.explain("NOPE1")


def test_a_new_cell_is_the_text_that_the_command_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    draft = pp.new_cell(
        "a.toml", name="c", robot="KR 210 R2700-2", tool_xyz=(150, 0, 250), tool_axis="+x",
        tool_mass=35.0, workpiece_xyz=(1400, -60, 700), home=(0, -90, 90, 0, 30, 0),
        spindle="program",
    )  # fmt: skip
    assert not Path("a.toml").exists()
    call = (
        "new-cell -o b.toml --name c --robot kuka_kr210_r2700_2 --tool-xyz 150 0 250 --tool-axis "
        "+x --tool-mass 35 --workpiece-xyz 1400 -60 700 --home 0 -90 90 0 30 0 --spindle program"
    )
    told(capsys, *call.split())
    assert draft.write().read_text("utf-8") == Path("b.toml").read_text("utf-8")
    assert pp.check("a.toml").good
    with pytest.raises(pp.PostprocError, match="CLI013"):
        pp.new_cell("c.toml", robot="x")
    with pytest.raises(TypeError, match="colour"):
        pp.new_cell("c.toml", colour=1)
    with pytest.raises(pp.PostprocError, match="CLI011"):
        pp.new_cell("a.toml", robot="KR 210 R2700-2")


def test_a_measuring_plan_is_that_of_the_command(tmp_path, capsys):
    cell = pp.new_cell(tmp_path / "c.toml", robot="KR 500 R2830", tool_xyz=(0, 0, 300)).write()
    box = (1500, -150, 800, 1800, 150, 1100)
    plan = pp.sample(cell, box, grid_mm=300, forces_N=[(0, 300, 0)], load_kg=20)
    call = ("sample", "--cell", cell, "--box", *box, "--grid", 300, "--load-kg", 20)
    content = told(capsys, *call, "--force", 0, 300, 0, "-o", tmp_path / "cli")
    assert as_json(plan.document) == content
    plan.write(tmp_path / "api")
    for name in content["files"]:
        assert (tmp_path / "api" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes()


def test_a_batch_is_that_of_the_command(rows, tmp_path, capsys):
    (tmp_path / "bad.csv").write_text("no points\n", encoding="utf-8")
    inputs = [rows, tmp_path / "bad.csv"]
    done = pp.batch(inputs, CELL, tmp_path / "api", jobs=1)
    content = told(capsys, "batch", *inputs, "--cell", CELL, "-o", tmp_path / "cli", "-j", 1)
    assert not done.good
    ours = as_json(done.document())
    for entry in (*ours["entries"].values(), *content["entries"].values()):
        entry.pop("seconds", None)
    assert ours == content
    assert (tmp_path / "api" / "row.src").read_bytes() == (
        tmp_path / "cli" / "row.src"
    ).read_bytes()
    assert pp.batch(rows, CELL, tmp_path / "api").kept == [str(rows)]


def test_holes_from_arrays_are_those_of_the_list(rows):
    """The same numbers as arrays and as a file give the same program, but for its CAM lines."""
    cell = pp.load_cell(CELL)
    table = np.genfromtxt(rows, delimiter=",", names=True, dtype=None, encoding="utf-8")

    def columns(*names):
        return np.stack([table[name] for name in names], axis=1)

    known = {"rpm": table["rpm"]} if "rpm" in table.dtype.names else {}
    part = pp.holes(
        columns("x", "y", "z"), columns("i", "j", "k"), depth=table["depth"],
        feed=table["feed"], names=list(table["id"]), name="row", **known,
    )  # fmt: skip
    listed = pp.read(rows, cell)
    for name in ("points", "axes", "feed", "kind", "cycle"):
        np.testing.assert_allclose(getattr(part, name), getattr(listed, name), atol=1e-12)
    ours, theirs = pp.convert(part, cell), pp.convert(listed, cell)
    assert ours.good
    np.testing.assert_array_equal(ours.plan.q, theirs.plan.q)
    one = pp.holes([[0, 0, 0], [50, 0, 0]], [[0, 0, 1]] * 2, depth=12)
    assert {cycle.depth for cycle in one.cycles} == {0.012}


@pytest.mark.parametrize(
    "wrong",
    [
        {"xyz_mm": [[0, 0]]},
        {"xyz_mm": [0, 0, 0]},
        {"xyz_mm": np.zeros((0, 3)), "axes": np.zeros((0, 3))},
        {"xyz_mm": [[np.nan, 0, 0]]},
        {"axes": [[0, 0, 1], [0, 0, 1]]},
        {"depth": [1.0, 2.0]},
        {"depth": "deep"},
        {"depth": np.inf},
        {"names": ["a", "b"]},
        {"axes": [[0, 0, 0]]},
        {"depth": -3.0},
        {"feed": 0.0},
    ],
)
def test_arrays_that_are_no_holes_are_refused(wrong):
    given = {"xyz_mm": [[0, 0, 0]], "axes": [[0, 0, 1]], "depth": 5.0, **wrong}
    with pytest.raises(pp.PostprocError):
        pp.holes(given.pop("xyz_mm"), given.pop("axes"), **given)


def test_a_cell_answers_scripts_as_its_programs_do(rows):
    cell = pp.load_cell(CELL)
    assert pp.load_cell(CELL) is cell
    points = pp.convert(rows, cell).points
    q = np.stack([points[f"q{k}_deg"] for k in range(1, 7)], axis=1)
    T = cell.fk(q, frame="base")
    xyz = np.stack([points[name] for name in ("x_mm", "y_mm", "z_mm")], axis=1)
    np.testing.assert_allclose(T[:, :3, 3], xyz, atol=1e-6)
    assert cell.fk(q.reshape(1, -1, 6)).shape == (1, len(q), 4, 4)
    assert not cell.collides(q, cutting=True).any()
    for row in range(0, len(q), 5):
        found = cell.ik(T[row], frame="base")
        assert np.abs(found - q[row]).max(axis=1).min() < 1e-6
        np.testing.assert_allclose(
            cell.fk(found, frame="base"), np.tile(T[row], (len(found), 1, 1)), atol=1e-6
        )
    moved = cell.with_workpiece_at((1500, 100, 700), (10, 0, 0))
    np.testing.assert_allclose(moved.T_robroot_base[:3, 3], [1.5, 0.1, 0.7])
    assert cell.T_robroot_base[0, 3] != 1.5
    into_the_floor = cell.fk([0, 0, 0, 0, 0, 0])
    into_the_floor[:3, 3] = 9000.0
    assert cell.ik(into_the_floor).shape == (0, 6)
    for call in (
        lambda: cell.fk([0, 0, 0]), lambda: cell.fk(q, frame="tool"), lambda: cell.ik(np.eye(3)),
        lambda: cell.ik(2 * np.eye(4)), lambda: cell.collides([np.nan] * 6),
        lambda: cell.with_workpiece_at((1, 2)),
    ):  # fmt: skip
        with pytest.raises(pp.PostprocError, match="CEL034"):
            call()


def test_functions_of_a_script_are_objectives_and_emitters(rows):
    cell = pp.load_cell(CELL)
    tame = pp.convert(rows, cell, objective="axial")

    def outstretched(context):
        return -(context.q[:, 1] ** 2)

    def folded(context):
        return context.q[:, 1] ** 2

    one, other = (pp.convert(rows, cell, objective=wish) for wish in (outstretched, folded))
    assert one.good
    assert other.good
    assert one.cell.optimize.objective == "outstretched"
    work = [np.abs(job.plan.q[:, 1]).mean() for job in (one, other)]
    assert work[0] >= work[1]
    assert pp.convert(rows, cell, objective=folded).files == other.files
    assert one.page()

    from postproc.emitters import EMITTERS, Emitter

    kuka = EMITTERS.get("kuka_krl")

    class Own(Emitter):
        def emit(self, plan, cell):
            return kuka.emit(plan, cell)

        def read_back(self, program, cell, against):
            return kuka.read_back(program, cell, against)

    assert pp.convert(rows, cell, objective="axial", emitter=Own()).files == tame.files


def test_the_first_page_tries_fifty_places_in_fifteen_lines():
    """Its blocks run with the other pages; here only what it promises of its length."""
    page = (ROOT / "docs" / "tutorials" / "python.md").read_text(encoding="utf-8")
    block = next(part for part in page.split("```python\n")[1:] if "range(1000" in part)
    assert len([line for line in block.split("```")[0].splitlines() if line.strip()]) <= 15
