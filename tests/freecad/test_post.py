import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from postproc.cli import app
from postproc.krl.text.parse import parse_module
from postproc.krl.text.program import Axes, Move, MoveWord, Pose
from postproc.model.toolpath import EventKind, MotionKind
from postproc.readers.base import ReadOptions, read
from postproc.units import MM, MM_PER_MIN
from tests.cells import STIFFNESS, cell_text
from tests.places import ROOT

ADD_ON = ROOT / "docs" / "examples" / "freecad"
POST = ADD_ON / "postproc_krl_post.py"
CONFIGURATION = """<FCParameters><FCParamGroup Name="Root"><FCParamGroup Name="BaseApp">
<FCParamGroup Name="Preferences"><FCParamGroup Name="General">
<FCText Name="AutoloadModule">PartWorkbench</FCText>
</FCParamGroup></FCParamGroup></FCParamGroup></FCParamGroup></FCParameters>
"""


@pytest.fixture(scope="module")
def post():
    spec = importlib.util.spec_from_file_location("postproc_krl_post", POST)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@dataclass
class Command:
    Name: str
    Parameters: dict


@dataclass
class Commands:
    Commands: list


@dataclass
class Item:
    Label: str
    Path: Commands
    Active: bool = True
    Group: list = field(default_factory=list)


def item(label, *commands):
    return Item(label, Commands([Command(name, words) for name, words in commands]))


def toolpath(post, tmp_path, *items):
    path = tmp_path / "job.apt"
    path.write_text(post.apt_of(items, "job"))
    return read(str(path), ReadOptions(format="apt", dialect="apt"))


def test_motions_feeds_and_events(post, tmp_path):
    found = toolpath(
        post,
        tmp_path,
        item("tool", ("M6", {"T": 3.0}), ("M3", {"S": 3000.0})),
        item(
            "Contour",
            ("(a comment)", {}),
            ("G0", {"Z": 30.0}),
            ("G0", {"X": 1.0, "Y": 2.0}),
            ("M8", {}),
            ("G1", {"Z": -1.5, "F": 5.0}),
            ("G1", {"X": 41.0}),
            ("M9", {}),
        ),
    )
    expected = [[1, 2, 30], [1, 2, -1.5], [41, 2, -1.5]]
    np.testing.assert_allclose(found.points / MM, expected)
    np.testing.assert_allclose(found.feed[1:] / MM_PER_MIN, 300.0)
    assert list(found.kind) == [MotionKind.RAPID, MotionKind.LINEAR, MotionKind.LINEAR]
    assert [tool.number for tool in found.tools] == [3]
    assert [operation.name for operation in found.operations] == ["Contour"]
    kinds = [event.kind for event in found.events]
    for kind in (EventKind.SPINDLE_ON, EventKind.COOLANT_ON, EventKind.COOLANT_OFF):
        assert kind in kinds
    assert found.unknown_words == {}


@pytest.mark.parametrize(("name", "sign"), [("G2", -1.0), ("G3", 1.0)])
def test_an_arc_turns_as_in_g_code(post, tmp_path, name, sign):
    """A quarter about (10, 0) from (0, 0): G2 goes up to +y, G3 down to -y."""
    found = toolpath(
        post,
        tmp_path,
        item(
            "a",
            ("G0", {"X": 0.0, "Y": 0.0, "Z": 0.0}),
            (name, {"X": 10.0, "Y": -10.0 * sign, "I": 10.0, "J": 0.0, "F": 10.0}),
        ),
    )
    np.testing.assert_allclose(found.arcs.centre[0] / MM, [10, 0, 0])
    np.testing.assert_allclose(found.arcs.normal[0], [0, 0, sign])
    assert found.arcs.sweep[0] == pytest.approx(np.pi / 2)


def test_drilling_cycles(post, tmp_path):
    found = toolpath(
        post,
        tmp_path,
        item(
            "Drilling",
            ("G0", {"X": 0.0, "Y": 0.0, "Z": 30.0}),
            ("G98", {}),
            ("G83", {"X": 5.0, "Y": 6.0, "Z": -12.0, "R": 3.0, "Q": 4.0, "F": 2.0}),
            ("G83", {"X": 15.0, "Y": 6.0}),
            ("G80", {}),
            ("G82", {"X": 25.0, "Y": 6.0, "Z": -5.0, "R": 3.0, "P": 0.5, "F": 2.0}),
        ),
    )
    holes = np.flatnonzero(found.kind == MotionKind.HOLE)
    np.testing.assert_allclose(found.points[holes] / MM, [[5, 6, 3], [15, 6, 3], [25, 6, 3]])
    first, last = (found.cycles[int(found.cycle[holes[i]])] for i in (0, 2))
    assert (first.depth / MM, first.clearance, first.retract / MM) == pytest.approx((15, 0, 27))
    assert first.peck / MM == pytest.approx(4.0)
    assert (last.depth / MM, last.dwell) == pytest.approx((8.0, 0.5))
    assert first.feed / MM_PER_MIN == pytest.approx(120.0)


def test_operations_that_are_switched_off_are_left_out(post, tmp_path):
    off = item("Off", ("G0", {"X": 9.0, "Y": 9.0, "Z": 9.0}))
    off.Active = False
    inner = item("In", ("G0", {"X": 1.0, "Y": 1.0, "Z": 1.0}))
    outer = item("Out")
    outer.Group = [off, inner]
    np.testing.assert_allclose(toolpath(post, tmp_path, outer).points / MM, [[1, 1, 1]])


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("G1", {"A": 30.0, "F": 5.0}), "rotary axis A"),
        (("G91", {}), "G91"),
        (("G41", {}), "G41"),
        (("G38.2", {"Z": 0.0}), "G38.2"),
        (("G1", {"X": 5.0}), "without a feed"),
        (("M123", {}), "M123 is not known"),
        (("G2", {"X": 5.0, "F": 5.0}), "without a radius"),
    ],
)
def test_what_cannot_be_handed_on_is_refused(post, command, words):
    start = ("G0", {"X": 0.0, "Y": 0.0, "Z": 0.0})
    with pytest.raises(post.PostError, match=words):
        post.apt_of([item("a", start, command)], "job")


def test_arguments(post, tmp_path):
    with pytest.raises(post.PostError, match="no cell"):
        post.export([], str(tmp_path / "a.src"), "")
    with pytest.raises(post.PostError, match="--colour"):
        post.export([], str(tmp_path / "a.src"), "--colour=red")
    with pytest.raises(post.PostError, match="cannot be started"):
        post.export([], str(tmp_path / "a.src"), "--cell=c.toml --postproc=no_such_command_here")


def command():
    """The words that start FreeCAD without a window; the test is skipped where there is none.

    ``POSTPROC_FREECAD`` names the command of one that is not on the PATH, ``POSTPROC`` that of
    postproc where that FreeCAD sees it.
    """
    named = os.environ.get("POSTPROC_FREECAD", "").split()
    found = named or [c for c in map(shutil.which, ("freecadcmd", "FreeCADCmd")) if c][:1]
    if not found:
        pytest.skip("freecadcmd is not installed (Debian package freecad)")
    return found


def run_job(folder, words):
    """Run the job script in a FreeCAD that has the add-on; return what it tells."""
    kept = (".local/share/FreeCAD/Mod", ".FreeCAD/Mod")  # of 1.0 and 0.20, of older ones
    for place in kept:
        shutil.copytree(ADD_ON, folder / place / "postproc_krl")
    for place in (".config/FreeCAD", ".FreeCAD"):
        (folder / place).mkdir(parents=True, exist_ok=True)
        (folder / place / "user.cfg").write_text(CONFIGURATION)
    (folder / "cell.toml").write_text(cell_text(STIFFNESS))
    environment = {
        "POSTPROC": f"{sys.executable} -m postproc",
        "QT_QPA_PLATFORM": "offscreen",
        **os.environ,
        "HOME": str(folder),
        "TARGET": str(folder / "plate.src"),
        "CELL": str(folder / "cell.toml"),
        "ANSWER": str(folder / "answer.json"),
    }
    script = folder / "job_script.py"
    shutil.copy(Path(__file__).parent / "job_script.py", script)
    done = subprocess.run(
        [*words, str(script)], env=environment, capture_output=True, timeout=300, check=False
    )
    assert (folder / "answer.json").is_file(), (done.stdout[-500:], done.stderr[-2000:])
    answer = json.loads((folder / "answer.json").read_text())
    assert "error" not in answer, answer["error"]
    return answer


@pytest.fixture(scope="module")
def freecad(tmp_path_factory):
    """A real job of FreeCAD, posted: the folder and what the script tells."""
    folder = tmp_path_factory.mktemp("freecad")
    return folder, run_job(folder, command())


def test_the_command_of_the_workbench_posts_the_selected_job(tmp_path):
    *before, name = command()
    window = re.sub("cmd$", "", name, flags=re.IGNORECASE)
    if not before and shutil.which(window) is None:
        pytest.skip("this FreeCAD has no window")
    assert run_job(tmp_path, [*before, window])["said"] == []
    assert (tmp_path / "plate.src").read_text(encoding="latin-1").startswith("&ACCESS")


def test_a_job_of_freecad_becomes_a_program(freecad):
    folder, answer = freecad
    assert answer["text"].startswith("&ACCESS")
    apt = (folder / "plate.apt").read_text()
    assert "LOADTL/1\n" in apt
    assert ",TOOL," in apt
    assert apt.endswith("SPINDL/OFF\nFINI\n")
    assert (folder / "plate.dat").is_file()
    code = app.run(
        [
            *("verify", str(folder / "plate.src"), "--cell", str(folder / "cell.toml"), "-q"),
            *("--against", str(folder / "plate.apt"), "--format", "apt", "--dialect", "apt"),
        ]
    )
    assert code == 0


def test_parts_of_a_split_job_are_programs_of_their_own(freecad):
    """A part has the name of its own file, its work offset, its tool and its spindle."""
    folder, answer = freecad
    if "exists" not in answer:
        pytest.skip("this FreeCAD splits jobs by itself, and names the files")
    assert answer["exists"]
    for offset, name in (("54", "two_G54"), ("55", "two_G55_1")):
        text = (folder / f"{name}.apt").read_text()
        assert text.startswith(f"PARTNO/{name}\n")
        assert f"ZERO/{offset}\n" in text
        assert "LOADTL/1\nSPINDL/RPM,3000,CLW\n" in text


@pytest.mark.parametrize(
    ("given", "name"),
    [("a/plate.nc", "plate"), ("2 x-y.src", "P2_x_y"), (f"{'n' * 40}.src", "n" * 24)],
)
def test_a_program_has_a_name_of_krl(post, given, name):
    assert post.program_file(given).stem == name


def test_the_end_stops_what_runs(post):
    on = item("a", ("M3", {"S": 100.0}), ("M8", {}))
    assert post.apt_of([on], "a").endswith("SPINDL/OFF\nCOOLNT/OFF\nFINI\n")
    off = item("b", ("M5", {}), ("M9", {}))
    assert post.apt_of([on, off], "a").endswith("SPINDL/OFF\nCOOLNT/OFF\nFINI\n")
    assert post.apt_of([on, off], "a").count("SPINDL/OFF") == 1


def test_the_program_goes_where_freecad_says(freecad):
    """Every cutting end point of FreeCAD's own path stands in the program, in order."""
    folder, answer = freecad
    place, wanted = {}, []
    for name, words in answer["commands"]:
        place |= {axis: words[axis] for axis in "XYZ" if axis in words}
        if name in ("G1", "G2", "G3", "G81", "G83"):
            wanted.append([place[axis] for axis in "XYZ"])
    assert any(name in ("G2", "G3") for name, _ in answer["commands"])
    assert sum(name in ("G81", "G83") for name, _ in answer["commands"]) >= 3
    targets = [
        [m.target.x_mm, m.target.y_mm, m.target.z_mm]
        for m in parse_module(folder / "plate.src").main.statements
        if isinstance(m, Move) and m.word is not MoveWord.PTP and isinstance(m.target, Pose)
    ]
    assert not any(isinstance(t, Axes) for t in targets)
    found, row = np.array(targets), 0
    for point in wanted:
        near = np.flatnonzero(np.linalg.norm(found[row:] - point, axis=1) < 2e-3)
        assert len(near), f"{point} is not in the program behind motion {row}"
        row += int(near[0])
