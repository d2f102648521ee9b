"""What `diff` says of tools and bases, and what sections and batches do with them."""

import json
import re

import pytest

from postproc.cell.file import load_cell
from postproc.controller.modules import load_program
from postproc.kinematics import build
from postproc.paths import run_in_cell
from tests import wing
from tests.jobs.emitted import written_program

pytestmark = pytest.mark.usefixtures("batch_here")
OPTIONS = "[optimize]\nstep_deg = 30\n[krl]\nsetup = true\n"


@pytest.fixture
def program(tmp_path):
    """Return a function that converts the wing panel in a changed cell into a folder."""

    def make(name, change=lambda text: text, source=None):
        folder = tmp_path / name
        folder.mkdir()
        cam, cell = folder / "wing.csv", folder / "cell.toml"
        cam.write_text(source or wing.csv_text(3))
        cell.write_text(change(wing.cell_text(OPTIONS)))
        return written_program(cam, cell).parent

    return make


@pytest.mark.parametrize(
    ("old", "new", "kind", "words"),
    [
        ("number = 8\n", "number = 12\n", "tool", "tool 8 became 12"),
        ("number = 4\n", "number = 14\n", "base", "base 4 became 14"),
        ("mass_kg = 81", "mass_kg = 91", "data", "LOAD_DATA[8]=M {81},"),
        ("[95.0, 0, 362]", "[96.5, 0, 362]", "data", "TOOL_DATA[8]=X 95,"),
        ("[1500.0, 200.0, 600.0]", "[1500.0, 201.0, 600.0]", "data", "BASE_DATA[4]=X 1500,Y 200,"),
    ],
)
def test_a_changed_tool_or_base_is_named(program, run, old, new, kind, words):
    before = program("before")
    after = program("after", lambda text: text.replace(old, new, 1))
    code, document, _ = run("diff", before, after, "--json")
    assert code == 1
    found = [item for item in document["differences"] if item["kind"] == kind]
    assert any(item["detail"].startswith(words) for item in found), document["counts"]
    assert "Aggregate" not in json.dumps(document)
    for item in found[:3]:
        assert item["old_line"] is not None
        assert item["new_line"] is not None


def test_another_tool_at_one_hole_is_named_there(program, run):
    rows = wing.csv_text(3).splitlines()
    assert rows[5].split(",")[-2:] == ["2", "MSYS_1"]
    rows[5] = rows[5].replace(",2,MSYS_1", ",1,MSYS_1")
    before, after = program("before"), program("after", source="\n".join([*rows, ""]))
    code, document, _ = run("diff", before / "wing.src", after / "wing.src", "--json")
    assert code == 1
    text = (before / "wing.src").read_text().splitlines()
    lines = {item["old_line"] for item in document["differences"] if item["kind"] == "tool"}
    assert lines
    assert all("CAM line 6" in text[line - 1] for line in lines)
    assert run("diff", before, before, "--json")[:1] == (0,)


def frames_of(folder, cell):
    """Return the (TOOL, BASE) pairs of the path motions of every program of a folder."""
    loaded, found = load_cell(cell), {}
    for file in sorted(folder.glob("*.src")):
        if file.stem.upper().endswith("_SETUP"):
            continue
        modules = load_program(file)
        trace = run_in_cell(modules, modules[0].name, loaded, build(loaded.robot))
        numbers = (trace.column("tool_number"), trace.column("base_number"))
        found[file.stem] = {
            (int(t), int(b)) for t, b, cp in zip(*numbers, trace.is_cp, strict=True) if cp
        }
    return found


@pytest.mark.parametrize("rule", ["count:3", "region:60"])
def test_every_section_selects_its_own_frames(tmp_path, run, rule):
    """Each section is a program of its own: it begins with the tool and base of its first hole."""
    cam, cell, out = tmp_path / "wing.csv", tmp_path / "cell.toml", tmp_path / "out"
    text = wing.csv_text(3).splitlines()
    if rule.startswith("region"):
        text = [text[0], *(row for row in text[1:] if re.search(r",3,MSYS_1$", row))]
    cam.write_text("\n".join([*text, ""]))
    cell.write_text(wing.cell_text("[optimize]\nstep_deg = 30\n"))
    call = ("batch", cam, "--cell", cell, "-o", out, "--split", rule, "--jobs", 1, "--json")
    code, _, err = run(*call)
    assert code == 0, err
    found = frames_of(out, cell)
    if rule == "region:60":
        assert list(found.values()) == [{(9, 3)}] * 2, "the section and the program that calls it"
        return
    assert len(found.pop("wing")) == 6, "the program that calls them"
    assert len(found) == 6
    want = [{(6 + tool, 2 + setup)} for setup in (1, 2) for tool in (1, 2, 3)]
    assert list(found.values()) == want
    for stem, ((tool, base),) in found.items():
        head = (out / f"{stem}.src").read_text()
        first = re.search(r"(?m)^(PTP|LIN)", head).start()
        assert f"BAS(#TOOL,{tool})" in head[:first]
        assert f"BAS(#BASE,{base})" in head[:first]
        assert f"PP_TOOL_CHANGE({tool - 6})" in head


def test_a_batch_redoes_what_another_tool_changes(tmp_path, run):
    """Manifest and second run: a changed tool redoes all, an unchanged cell nothing."""
    inputs, cell, out = tmp_path / "in", tmp_path / "cell.toml", tmp_path / "out"
    inputs.mkdir()
    (inputs / "wing.csv").write_text(wing.csv_text(2))
    (inputs / "rest.csv").write_text(
        wing.csv_text(1).replace("MCS_2", "MCS_9")
    )  # a setup that nobody claims
    cell.write_text(wing.cell_text("[optimize]\nstep_deg = 30\n"))
    call = ("batch", inputs, "--cell", cell, "-o", out, "--jobs", 1, "--json")
    code, document, _ = run(*call)
    assert code == 1
    assert [name.split("/")[-1] for name in document["failed"]] == ["rest.csv"]
    entries = json.loads((out / "manifest.json").read_text())["entries"]
    state = {name.split("/")[-1]: entry for name, entry in entries.items()}
    assert state["wing.csv"]["status"] == "ok"
    assert "setup MCS_9" in state["rest.csv"]["errors"][0]
    before = (out / "wing.src").read_bytes()
    _, document, _ = run(*call)
    assert document["kept"] == 1
    cell.write_text(wing.cell_text("[optimize]\nstep_deg = 30\n", longer={3: 4.0}))
    _, document, _ = run(*call)
    assert document["kept"] == 0
    assert (out / "wing.src").read_bytes() != before
