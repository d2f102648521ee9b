"""The way a program goes home: axis values, XHOME, or the form that a pad itself writes."""

import re
from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from postproc.cell import parse_cell
from postproc.cell.schema import Motion, Read
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.errors import CellError
from postproc.kinematics import build
from postproc.krl import lint, load_modules
from postproc.model.plan import MoveKind
from postproc.paths.world import run_in_cell
from postproc.units import DEG
from tests.places import snapshot

from . import plans, texts

HOME = {"q_deg": plans.HOME / DEG, "kind": MoveKind.PTP, "tag": -1, "ptp": 1.0}
NEAR = {"q_deg": plans.HOME / DEG + 3.0, "kind": MoveKind.PTP}


def program(folder, events=(), **krl):
    """A plan from home through a cut and back; the cell, and the files written to a folder."""
    motion = TypeAdapter(Read[Motion]).validate_python(
        {"feed_mm_min": 600.0, "home_deg": list(plans.HOME / DEG)}
    )
    cell = replace(plans.cell(**krl), motion=motion)
    moves = [HOME, NEAR, {"blend_mm": 1.0, "xyz_mm": (20, 0, 0)}, {"xyz_mm": (30, 0, 0)}, HOME]
    files = render_files(emit(plans.plan(moves, events=events), cell))
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return cell, files


def squeezed(text):
    """A line as its words: pads of different versions set blanks differently."""
    text = re.sub(r"%R [\d.]+,", "", text)
    return re.sub(r"\s*([,;=()%])\s*", r"\1", " ".join(text.split())).upper()


def starts(line, word):
    """Whether a line begins a form of HOME at 100 %."""
    return squeezed(line).startswith(f";FOLD {word} HOME VEL=100")


def form(lines, word):
    """The lines of the first form of HOME at 100 %, as far as its motion."""
    first = next(i for i, line in enumerate(lines) if starts(line, word))
    count = next(i for i, line in enumerate(lines[first:]) if word in line.split())
    return [squeezed(line) for line in lines[first : first + count + 1]]


@pytest.mark.parametrize("motion", ["dense", "spline", "spline_block", "forms"])
@pytest.mark.parametrize("kss", ["8.3", "8.6"])
@pytest.mark.parametrize("home", ["axes", "xhome", "form"])
def test_every_way_ends_in_the_same_axes_and_leaves_tool_and_base(tmp_path, home, kss, motion):
    is_spline = motion.startswith("spline")
    if home == "form" and is_spline and kss == "8.3":
        pytest.skip("no form of an SPTP is known for KSS 8.3")
    cell, files = program(tmp_path, home=home, kss=kss, motion=motion)
    modules = load_modules([tmp_path])
    assert not [f for f in lint(modules) if f.severity == "error"]
    trace = run_in_cell(modules, "TEST", cell, build(cell.robot))
    assert not [f for f in trace.findings if f.severity == "error"]
    assert len(trace) == 5
    for at in (0, 4):
        assert trace.is_axes[at] or (home, motion) == ("axes", "forms")
        if trace.is_axes[at]:
            np.testing.assert_allclose(trace.target[at], plans.HOME, atol=1e-6)
    for at in (1, 2, 3):
        setting = trace.settings[trace.setting[at]]
        assert (setting.tool_number, setting.base_number, setting.load_number) == (1, 2, 1)
    words = [line.split(";")[0].split("WITH")[0].strip() for line in texts.lines(files, "TEST.src")]
    expected = 0 if home == "axes" else 2
    assert sum(word in ("PTP XHOME", "SPTP XHOME") for word in words) == expected


@pytest.mark.parametrize(
    ("repository", "kss", "motion", "word"),
    [
        ("Naqiu06/KUKA-Robotics", "8.3", "dense", "PTP"),
        ("Aleynikovich/Zinkerreka", "8.6", "spline", "SPTP"),
    ],
)
def test_the_form_is_that_of_a_real_controller(tmp_path, repository, kss, motion, word):
    _, files = program(tmp_path, home="form", kss=kss, motion=motion)
    ours = form(texts.lines(files, "TEST.src"), word)
    ours = [re.sub(r"PTP_PARAMS,100\.0+", "PTP_PARAMS,100", line) for line in ours]
    theirs = []
    for path in sorted(snapshot(repository).rglob("*.src")):
        lines = path.read_text("latin-1").splitlines()
        if any(starts(line, word) for line in lines):
            theirs.append(form(lines, word))
    assert ours in theirs


def test_a_home_of_the_controller_is_refused_where_it_says_too_little():
    text = 'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'
    home = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\n"
    axis = '[[external_axes]]\nname = "E1"\nkind = "rail"\naxis = "+y"\n'
    axis += "range_mm = [-1, 1]\nspeed_mm_s = 1\n"
    tool = '[tool]\nnumber = 7\naxis = "+x"\n'
    cases = {
        text + '[krl]\nhome = "xhome"\n': "needs home_deg",
        text + home + axis + '[krl]\nhome = "xhome"\n': "external axes",
        text + home + tool + '[krl]\nhome = "form"\n': "selects tool 1",
        text + home + '[krl]\nhome = "form"\nkss = "8.3"\nmotion = "spline"\n': "8.6",
    }
    for wrong, words in cases.items():
        with pytest.raises(CellError, match=words):
            parse_cell(wrong.encode(), "cell.toml")
    assert parse_cell((text + home + tool + '[krl]\nhome = "xhome"\n').encode(), "cell.toml")
