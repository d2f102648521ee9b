"""Holes drilled by plain moves, in a solid part: the drill comes back in rapid to its last peck."""

import pytest

from tests.cells import FEED, cell_text
from tests.jobs.emitted import converted
from tools.bench.contours import SOLIDS

PART = 'meshes = [{ name = "part", box = { size_mm = [200, 200, 40] }, xyz_mm = [0, 0, -20] }]\n'


def pecks(*steps, back=1.0, aside=0.0, out="RAPID"):
    """Return APT that drills to depths [mm] one after the other; comes back so much above [mm]."""
    lines = ["PARTNO/PECKS", "UNITS/MM", "SPINDL/3000,RPM,CLW", "RAPID", "GOTO/0,0,50,0,0,1"]
    lines += ["RAPID", "GOTO/0,0,3"]
    for before, depth in zip((0.0, *steps), steps, strict=False):
        if before:
            lines += ["RAPID", f"GOTO/{aside},0,{back - before}"]
        lines += ["FEDRAT/200,MMPM", f"GOTO/{aside},0,{-depth}", out, f"GOTO/{aside},0,3"]
    return "\n".join([*lines, "RAPID", "GOTO/0,0,50", "SPINDL/OFF", "FINI", ""])


@pytest.mark.parametrize("out", ["RAPID", "FEDRAT/800,MMPM"])
@pytest.mark.parametrize("most", [2, 3, 4, 5, 8, 1000])
def test_it_runs_wherever_files_end(tmp_path, most, out):
    cell = cell_text(PART, FEED, f"[krl]\nmax_points_per_file = {most}\n", tool=SOLIDS)
    job = converted(tmp_path, pecks(5.0, 10.0, 15.0, out=out), "pecks.apt", cell)
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]


@pytest.mark.parametrize(("back", "aside"), [(-1.0, 0.0), (1.0, 2.0)])
def test_not_deeper_nor_beside_it(tmp_path, back, aside):
    text = pecks(5.0, 10.0, back=back)
    text = text if not aside else text.replace("GOTO/0.0,0,-4", f"GOTO/{aside},0,-4")
    job = converted(tmp_path, text, "pecks.apt", cell_text(PART, FEED, tool=SOLIDS))
    assert [finding.code for finding in job.findings if finding.is_error][:1] == ["PLN104"]


@pytest.mark.parametrize("height", [10, 20, 30])
def test_a_feed_move_behind_a_hole(tmp_path, height):
    """At 20 mm the tool stands already when it has left the hole."""
    text = (
        "PARTNO/P\nUNITS/MM\nSPINDL/3000,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\n"
        "CYCLE/DRILL,FEDTO,10,MMPM,300,RAPTO,3,RTRCTO,20\nGOTO/0,0,0\nCYCLE/OFF\n"
        f"FEDRAT/300,MMPM\nGOTO/0,0,{height}\nGOTO/30,0,{height}\nGOTO/30,0,-2\n"
        "RAPID\nGOTO/30,0,50\nSPINDL/OFF\nFINI\n"
    )
    job = converted(tmp_path, text, "hole.apt", cell_text(FEED))
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
