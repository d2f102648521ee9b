"""Who starts the spindle: convert, verify and the pages judge alike, and say it first."""

import itertools

import pytest

from tests.cells import FEED, cell_text

COARSE = "[optimize]\nstep_deg = 60\n"

HOLES = "id,x,y,z,i,j,k,depth,feed\nH1,0,0,0,0,0,1,5,120\nH2,40,0,0,0,0,1,5,120\n"
TOUCHES = "id,x,y,z,i,j,k\nP1,0,0,0,0,0,1\nP2,50,0,0,0,0,1\n"
LINE = "x,y,z,i,j,k,feed\n0,0,0,0,0,1,600\n90,0,0,0,0,1,600\n"
CUT = "RAPID\nGOTO/0,0,50,0,0,1\nFEDRAT/600,MMPM\nGOTO/0,0,0\nGOTO/50,0,0\nRAPID\nGOTO/50,0,50\n"
JOBS = {
    "holes.csv": HOLES,
    "touches.csv": TOUCHES,
    "line.csv": LINE,
    "silent.apt": f"UNITS/MM\n{CUT}FINI\n",
    "told.apt": f"UNITS/MM\nSPINDL/900,RPM,CLW\n{CUT}SPINDL/OFF\nFINI\n",
}
CELLS = {
    "silent": "",
    "program": 'spindle = "program"\n',
    "speed": "spindle_rpm = 3000\n",
    "hand": 'spindle = "hand"\n',
    "feeds": 'feed_by = "unit"\n',
}
NEEDS = {"holes.csv", "line.csv", "silent.apt"}


def expected(job, who):
    """Exit code of convert, whether it warns, and the speed that the program starts with."""
    if job not in NEEDS:
        return 0, False, 900 if job == "told.apt" and who != "hand" else None
    if who == "speed":
        return 0, False, 3000
    return int(who == "program"), who == "silent", None


def judged(run, source, cell, out):
    """What convert says, and verify of what it wrote, with and without the CAM file."""
    code, document, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    text = next(out.glob("*.src")).read_text() if out.exists() else ""
    lines = [line for line in text.splitlines() if line.startswith("PP_SPINDLE_ON")]
    speed = int(lines[0].split("(")[1].split(")")[0]) if lines else None
    warnings = document["warnings"]
    found = [(code, "the program does not start" in (warnings or [{"text": ""}])[0]["text"], speed)]
    if code:
        assert document["failures"][0]["code"] == "PRC004"
        assert "error PRC004" in err.splitlines()[0]
        return found
    for more in ((), ("--against", source)):
        program = next(out.glob("*.src"))
        code, report, _ = run("verify", program, "--cell", cell, "--json", *more)
        warnings = report["warnings"] or [{"detail": ""}]
        found.append((code, "does not start the spindle" in warnings[0]["detail"], speed))
    return found


@pytest.mark.slow
def test_every_job_in_every_cell(tmp_path, run):
    wrong = []
    for job, who in itertools.product(JOBS, CELLS):
        if who == "feeds" and job in ("silent.apt", "told.apt"):
            continue  # plunges that the unit would make again
        folder = tmp_path / f"{job}_{who}"
        folder.mkdir()
        source, cell = folder / job, folder / "cell.toml"
        source.write_text(JOBS[job])
        cell.write_text(cell_text(FEED, COARSE, f"[process]\n{CELLS[who]}"))
        wanted = expected(job, who)
        found = judged(run, source, cell, folder / "out")
        if job == "touches.csv":
            found = found[::2]  # without the file a touch looks as a cut does
        wrong += [(job, who, wanted, one) for one in found if one != wanted]
    assert not wrong


def test_the_program_is_judged_by_what_the_cell_says_now(tmp_path, run):
    """What was made for a spindle by hand is bad in a cell whose program has to start it."""
    source, cell, out = tmp_path / "holes.csv", tmp_path / "cell.toml", tmp_path / "out"
    source.write_text(HOLES)
    cell.write_text(cell_text(FEED, COARSE, '[process]\nspindle = "hand"\n'))
    run("convert", source, "--cell", cell, "-o", out, "--json")
    cell.write_text(cell_text(FEED, COARSE, '[process]\nspindle = "program"\n'))
    for more in ((), ("--against", source)):
        code, report, _ = run("verify", out / "holes.src", "--cell", cell, "--json", *more)
        assert (code, report["violations"][0]["kind"]) == (1, "spindle")


def test_the_speed_of_the_cell_turns_as_each_tool_cuts(tmp_path, run):
    """Also across a tool change, where the first tool's way round would break the second."""
    frame = 'frame = { xyz_mm = [107, 0, 362], abc_deg = [0, 0, 0] }\naxis = "+x"\n'
    tools = (
        f'[[tools]]\nnumber = 1\nname = "a"\ncam = ["1"]\n{frame}'
        f'[[tools]]\nnumber = 2\nname = "b"\ncam = ["2"]\nspindle = "ccw"\n{frame}'
    )
    text = cell_text(FEED, COARSE, "[process]\nspindle_rpm = 3000\n")
    head, base = text.split("[tool]")[0], "[workpiece]" + text.split("[workpiece]")[1]
    source, cell, out = tmp_path / "two.apt", tmp_path / "cell.toml", tmp_path / "out"
    cell.write_text(f"{head}{tools}{base}")
    source.write_text(f"UNITS/MM\nLOADTL/1\n{CUT}LOADTL/2\n{CUT}FINI\n")
    code, _, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    lines = [line.split(" ;")[0] for line in (out / "two.src").read_text().splitlines()]
    calls = [line for line in lines if line.startswith("PP_")]
    assert calls == [
        "PP_TOOL_CHANGE(1)", "PP_SPINDLE_ON(3000)", "PP_SPINDLE_OFF()", "PP_TOOL_CHANGE(2)",
        "PP_SPINDLE_ON(-3000)", "PP_SPINDLE_OFF()",
    ]  # fmt: skip
    assert run("verify", out / "two.src", "--cell", cell, "--against", source, "--json")[0] == 0


def test_the_first_lines_say_it(tmp_path, capsys):
    from postproc.cli import app

    source, cell, out = tmp_path / "holes.csv", tmp_path / "cell.toml", tmp_path / "out"
    source.write_text(HOLES)
    cell.write_text(cell_text(FEED, COARSE))
    pages = [tmp_path / "convert.html", tmp_path / "verify.html"]
    call = ["convert", source, "--cell", cell, "-o", out, "--report", pages[0]]
    assert app.run([str(word) for word in call]) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0].startswith("careful  the program does not start the spindle")
    assert "warning PRC004" in said.err.splitlines()[0]
    call = ["verify", out / "holes.src", "--cell", cell, "--report", pages[1]]
    assert app.run([str(word) for word in call]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "the program does not start the spindle" in said[0]
    assert said[-1].startswith("good")
    assert "does not start the spindle" in said[-1]
    for page in pages:
        lead = page.read_text().split('class="lead')[1].split("</p>")[0]
        assert "the program does not start the spindle" in lead


@pytest.mark.parametrize("who", ['spindle = "hand"', 'spindle = "unit"', 'feed_by = "unit"'])
def test_a_speed_of_a_spindle_that_the_program_does_not_start_is_refused(who, tmp_path, run):
    cell = tmp_path / "cell.toml"
    cell.write_text(cell_text(FEED, COARSE, f"[process]\n{who}\nspindle_rpm = 3000\n"))
    code, document, _ = run("check", cell, "--json")
    assert code == 2
    assert "spindle_rpm" in document["message"]
