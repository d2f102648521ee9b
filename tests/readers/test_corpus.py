"""Real files of five systems, where they are at hand: counts, arc senses, true reasons."""

import csv
import json
import re

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cli.app import run
from postproc.errors import CellError, ReadError
from postproc.model.toolpath import MotionKind
from postproc.process import assign, started_by_none, word_findings
from postproc.readers import ReadOptions, read
from postproc.readers.apt.arcs import tangency
from postproc.readers.apt.file import straight_neighbours

pytestmark = pytest.mark.corpus
DIALECTS = {"az": "solidworks", "azhist": "solidworks", "creo": "creo", "nx": "nx"}
REASONS = {
    "gtmi__cubes.csv": "CSV020",
    "gtmi__rob1_self_transform_092024.csv": "CSV020",
    "gtmi__robot_to_robot_091124.csv": "CSV020",
    "gtmitest__robot_cloud.csv": "CSV020",
    "pycatia__Sample_Point_CSV_File1_small.csv": "CSV020",
    "pycatia__Sample_Point_CSV_File3_medium.csv": "CSV020",
    "rabkkk__RobPoseatRef.csv": "CSV023",
    "rabkkk__TransToolPosit.csv": "CSV020",
    "robodk__Example-Import-CSV-XYZWPR.csv": "CSV013",
}
"""Why a file cannot be read as it is: no orientation, or columns that only a person can name."""


CELL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[workpiece]
frame = { xyz_mm = [1600, 0, 700] }
"""
HOME = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\nfeed_mm_min = 600\n[optimize]\nstep_deg = 30\n"
TOOLS, CUTCOM = "several tools", "--accept-words CUTCOM"
NEEDS = {
    "az__Dem-target1.apt": (),
    "az__Dem-target2.apt": (CUTCOM, TOOLS),
    "az__Leg-holder-thick.apt": (CUTCOM, TOOLS),
    "az__METIS-506-7-5-D-4-Collimator-support.apt": (CUTCOM, TOOLS),
    "az__Paralelipipedo-furos.apt": (TOOLS,),
    "az__Paralelipipedo.apt": (CUTCOM,),
    "az__RotateThick.apt": (CUTCOM, TOOLS),
    "az__Sacrifice-Board.apt": (CUTCOM, TOOLS),
    "az__SlewMachine.apt": (CUTCOM, TOOLS),
    "az__Suporte-parede-side-drill.apt": (),
    "az__Suporte-parede-top.apt": (CUTCOM, TOOLS),
    "az__Suporte-paredeH-edge.apt": (CUTCOM, TOOLS),
    "az__Suporte-paredeH-middle-drill.apt": (CUTCOM, TOOLS),
    "az__Suporte-paredeTrava-Direita.apt": (CUTCOM, TOOLS),
    "az__Suporte-paredeTrava.Esquerda.apt": (CUTCOM, TOOLS),
    "az__Teflon-gasket.apt": (CUTCOM, TOOLS),
    "az__Telemecanique-Tilt-Support.apt": (CUTCOM, TOOLS),
    "az__Telemecanique-Tilt-Support2.apt": (CUTCOM, TOOLS),
    "az__basemach.apt": (CUTCOM, TOOLS),
    "az__lateral-leg-holder.apt": (CUTCOM,),
    "az__manufacture3-bottom.apt": (CUTCOM, TOOLS),
    "azhist__Interface-glue2.apt": (CUTCOM,),
    "creo__bohren_1.ncl.8": (),
    "creo__profilfr_sen_2.ncl.1": (),
    "nx__TORETC_250_BOK.cls": (),
    "nx___10_KONTUR_125_N2_162.cls": (),
    "nx___1_KONTUR_NAR_40_N2.cls": (),
    "nx___2_KONTUR_VNUT_40_N2.cls": (),
    "nx___4_SVERL_63_N2.cls": (),
    "nx___6_KONTUR_125_N2_46.cls": (),
    "nx__standart_drill.clsf": (),
    "nx__ust_a.cls": (),
}
"""What each file needs before a program is made of it.

CUTCOM: SolidWorks CAM writes CUTCOM/LEFT and says nowhere whether its points are the tool centre or
the edge of the part; Creo (OUTPUT_ON_CENTER) and NX (centerline data) do. Several tools: one file
for each tool is needed, nothing else helps. Units: none, the NX files have no record but feeds in
MMPM.
"""
NO_SPINDLE = {name for name in NEEDS if name.startswith("nx__")}
"""They never name the spindle."""


def expectations(corpus):
    with (corpus / "EXPECTED_apt.tsv").open() as stream:
        return list(csv.DictReader(stream, delimiter="\t"))


def test_inspect_agrees_with_the_counts_of_every_file(corpus, capsys):
    rows = expectations(corpus)
    assert len(rows) >= 32
    for row in rows:
        assert run(["inspect", str(corpus / "apt" / row["file"]), "--json"]) == 0
        facts = json.loads(capsys.readouterr().out)
        words = facts["words"]
        assert facts["dialect"] == DIALECTS[row["file"].split("__")[0]]
        assert facts["points"] == int(row["goto3"]) + int(row["goto6"]), row["file"]
        assert facts["arcs"] == int(row["CIRCLE"])
        assert facts["rapid_points"] == int(row["RAPID"])
        for word in ("CYCLE", "FEDRAT"):
            assert words.get(word, 0) == int(row[word])
        changes = words.get("LOAD", 0) + words.get("LOADTL", 0) + words.get("TOOLNO", 0)
        assert changes == int(row["TOOLchange"])
        assert facts["tools"] <= max(changes, 1)
        assert facts["unknown_words"] == {}
        assert facts["units"] == "mm"


def test_what_each_file_needs_to_pass(corpus):
    assert sorted(NEEDS) == sorted(path.name for path in (corpus / "apt").iterdir())
    for name, needs in NEEDS.items():
        toolpath = read(corpus / "apt" / name)
        found = word_findings(toolpath)
        errors = [finding for finding in found if finding.is_error]
        assert [finding.code for finding in errors] == ["WRD001"] * (CUTCOM in needs), name
        assert all(CUTCOM in finding.hint for finding in errors)
        assert bool(len(started_by_none(toolpath))) == (name in NO_SPINDLE), name
        accepted = word_findings(toolpath.accepting(["CUTCOM"]))
        assert not any(finding.is_error for finding in accepted), name


def test_files_with_several_tools_need_them_in_the_cell(corpus, tmp_path):
    """One tool without a claim is refused; the table of inspect, filled in, assigned them all."""
    for name, needs in NEEDS.items():
        toolpath = read(corpus / "apt" / name)
        one = tmp_path / "one.toml"
        one.write_text(CELL + '[tool]\naxis = "+z"\n')
        if TOOLS not in needs:
            assert not assign(toolpath, load_cell(one)).findings, name
            continue
        with pytest.raises(CellError, match="is no tool of"):
            assign(toolpath, load_cell(one))
        many = tmp_path / "many.toml"
        many.write_text(CELL + tools_table(toolpath))
        assigned = assign(toolpath, load_cell(many))
        assert not [finding for finding in assigned.findings if finding.is_error], name
        cell = load_cell(many)
        for tag in (0, len(toolpath) // 2, len(toolpath) - 1):
            tool = toolpath.tools[toolpath.tool[tag]]
            assert str(tool.number) in cell.tools[assigned.tool[tag]].cam
        lines = np.asarray(toolpath.line)
        text = (corpus / "apt" / name).read_text(errors="replace").splitlines()
        calls = [i for i, line in enumerate(text, 1) if line.startswith("LOAD/TOOL")]
        for low, high in zip(calls, [*calls[1:], len(text)], strict=True):
            number = text[low - 1].partition(",")[2].split(",")[0].strip()
            mine = assigned.tool[(lines > low) & (lines < high)]
            assert {number in cell.tools[tool].cam for tool in mine.tolist()} <= {True}, name


SEVERAL = [name for name, needs in NEEDS.items() if TOOLS in needs]


@pytest.mark.slow
@pytest.mark.parametrize("name", SEVERAL)
def test_files_with_several_tools_convert(corpus, tmp_path, capsys, name):
    """With a tool of its own length for each number: into a program that comes back good."""
    cell = tmp_path / "cell.toml"
    toolpath = read(corpus / "apt" / name)
    cell.write_text(CELL + tools_table(toolpath) + HOME)
    source, out = str(corpus / "apt" / name), str(tmp_path / "out")
    call = ["convert", source, "--cell", str(cell), "-o", out, "--accept-words", "CUTCOM"]
    assert run([*call, "--name", "part", "--json"]) == 0, capsys.readouterr().err
    text = "".join(path.read_text() for path in sorted((tmp_path / "out").glob("*.src")))
    used = {toolpath.tools[index].number for index in toolpath.tool}
    numbers = {tool.cam[0]: tool.number for tool in load_cell(cell).tools}
    assert {int(n) for n in re.findall(r"BAS\(#TOOL,(\d+)\)", text)} == {
        numbers[str(number)] for number in used
    }
    assert {int(n) for n in re.findall(r"PP_TOOL_CHANGE\((\d+)\)", text)} == used
    capsys.readouterr()
    check = ["verify", f"{out}/part.src", "--cell", str(cell), "--against", source]
    assert run([*check, "--accept-words", "CUTCOM", "--json"]) == 0, capsys.readouterr()


@pytest.mark.parametrize("name", SEVERAL)
def test_the_table_of_inspect_can_be_pasted(corpus, tmp_path, capsys, name):
    """As it is printed it assigned every tool, and only the axes are asked for; then those fit."""
    source = str(corpus / "apt" / name)
    assert run(["inspect", source]) == 0
    table = capsys.readouterr().out.partition("for the cell, to be filled in:\n\n")[2]
    cell = tmp_path / "cell.toml"
    head = CELL.partition("[workpiece]")[0] if "[[bases]]" in table else CELL
    cell.write_text(head + table + HOME)
    call = ["convert", source, "--cell", str(cell), "-o", str(tmp_path / "out")]
    assert run([*call, "--accept-words", "CUTCOM"]) == 2
    assert "error CEL031: tool" in capsys.readouterr().err
    cell.write_text(head + table.replace("# axis =", "axis =") + HOME)
    assigned = assign(read(source), load_cell(cell))
    assert not [finding for finding in assigned.findings if finding.is_error]
    assert (assigned.tool >= 0).all()
    assert (assigned.base >= 0).all()
    if name not in SEVERAL[:3]:
        return  # that such cells convert is said above
    assert run([*call, "--accept-words", "CUTCOM", "--partial"]) in (0, 1)
    assert not re.search(r"error (WRD|CEL)", capsys.readouterr().err)


def tools_table(toolpath):
    """Return the tools of a file as a cell has them: each of its own length."""
    numbers = sorted({tool.number for tool in toolpath.tools})
    return "".join(
        f'[[tools]]\nnumber = {place}\ncam = ["{number}"]\naxis = "+x"\n'
        f"frame = {{ xyz_mm = [{100 + 5 * place}, 0, 362] }}\n"
        for place, number in enumerate(numbers, start=1)
    )


@pytest.mark.parametrize("name", ["az__Dem-target2.apt", "az__lateral-leg-holder.apt"])
def test_a_finding_names_every_line_of_the_word(corpus, name):
    """The lines are those that a plain search for the word finds; a dozen are named."""
    text = (corpus / "apt" / name).read_text()
    lines = [i for i, line in enumerate(text.splitlines(), 1) if line == "CUTCOM/LEFT"]
    (use,) = (use for use in read(corpus / "apt" / name).word_uses if use.refused)
    assert list(use.lines) == lines
    (finding,) = (f for f in word_findings(read(corpus / "apt" / name)) if f.code == "WRD001")
    assert finding.source.line == lines[0]
    shown = ", ".join(map(str, lines[1:13]))
    more = f" and {len(lines) - 13} more" if len(lines) > 13 else ""
    assert f"(also in lines {shown}{more})" in finding.message


def test_no_arc_goes_against_the_cuts_beside_it(corpus):
    """Leads are tangent in practice: every arc with a straight neighbour tells its true sense."""
    agree = against = 0
    for path in sorted((corpus / "apt").iterdir()):
        toolpath = read(path)
        tags = np.flatnonzero(toolpath.kind == MotionKind.ARC).astype(np.int32)
        if len(tags) == 0:
            continue
        before, after = straight_neighbours(toolpath.points, toolpath.kind, tags)
        ends = tangency(
            toolpath.arcs, toolpath.points[tags - 1], toolpath.points[tags], before, after
        ).sum(axis=1)
        agree += int((ends > 0).sum())
        against += int((ends < 0).sum())
    assert agree >= 900
    assert against == 0


def as_movarc(toolpath):
    """Return the motions of a file as a post writes them that turns vectors over."""

    def text(values):
        return ", ".join(f"{value:.6f}" for value in np.ravel(values))

    lines = ["UNITS/MM", "FEDRAT/500,MMPM"]
    for tag, point in enumerate(1e3 * toolpath.points):
        kind = toolpath.kind[tag]
        if kind == MotionKind.ARC:
            row, arcs = toolpath.arc[tag], toolpath.arcs
            numbers = text([1e3 * arcs.centre[row], arcs.normal[row]])
            radius, sweep = 1e3 * arcs.radius[row], np.degrees(arcs.sweep[row])
            lines.append(f"MOVARC/{numbers}, {text(radius)}, ANGLE, {text(sweep)}")
        lines += ["RAPID"] * int(kind == MotionKind.RAPID) + [f"GOTO/{text(point)}"]
    return "\n".join([*lines, "FINI\n"])


def test_no_real_half_turn_is_asked_back(corpus, read_text):
    """Every arc of every file, written as MOVARC: none stops, and each goes as it did."""
    halves = stops = 0
    for path in sorted((corpus / "apt").iterdir()):
        toolpath = read(path)
        again = read_text(as_movarc(toolpath))
        stops += sum(use.refused for use in again.word_uses)
        np.testing.assert_allclose(again.arcs.sweep, toolpath.arcs.sweep, atol=1e-3)
        normals = np.einsum("ni,ni->n", again.arcs.normal, toolpath.arcs.normal)
        assert (normals > 0.999).all(), path.name
        halves += int(np.isclose(toolpath.arcs.sweep % np.pi, 0.0, atol=1e-4).sum())
    assert (halves, stops) == (168, 0)


def test_helices_slope_by_the_round_angles_that_were_asked_for(corpus):
    """Ramp angles are set by people: 0.4 and 2 degrees come out only if TIMES,n is read right."""
    slopes = []
    for path in sorted((corpus / "apt").glob("nx*KONTUR*")):
        toolpath = read(path)
        for tag in np.flatnonzero(toolpath.kind == MotionKind.ARC):
            arc = toolpath.arc[tag]
            step = toolpath.points[tag] - toolpath.points[tag - 1]
            rise = abs(step @ toolpath.arcs.normal[arc])
            length = toolpath.arcs.radius[arc] * toolpath.arcs.sweep[arc]
            if rise > 1e-4:
                slopes.append(np.degrees(np.arctan2(rise, length)))
    np.testing.assert_allclose(slopes, [0.4, 2.0, 2.0, 0.4], atol=1e-6)


def test_point_lists_read_or_say_why_not(corpus):
    for path in sorted((corpus / "csv").iterdir()):
        with pytest.raises(ReadError) as caught:
            read(path)
        assert caught.value.code == REASONS[path.name], path.name
        assert "\n" not in str(caught.value)


def test_point_lists_read_with_a_surface(corpus):
    def up(points):
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))

    counts = {"gtmi__rob1_self_transform_092024.csv": 40, "gtmi__cubes.csv": 96,
              "pycatia__Sample_Point_CSV_File3_medium.csv": 1500}  # fmt: skip
    for name, count in counts.items():
        assert len(read(corpus / "csv" / name, options=ReadOptions(surface_normals=up))) == count


def test_poses_read_with_their_columns_named(corpus):
    poses = corpus / "csv" / "robodk__Example-Import-CSV-XYZWPR.csv"
    toolpath = read(poses, options=ReadOptions(columns="x,y,z,w,p,r,id"))
    assert len(toolpath) == 201
    np.testing.assert_allclose(toolpath.points[0] * 1e3, [-529.4597244, 399.4472885, 646.0984039])
    reference = corpus / "csv" / "rabkkk__RobPoseatRef.csv"
    assert len(read(reference, options=ReadOptions(columns="x,y,z,a,b,c"))) == 1


def test_delmia_sample(corpus):
    path = corpus / "delmia" / "dev_cut_simResult.xml"
    with pytest.raises(ReadError) as caught:
        read(path)
    assert caught.value.code == "DEL010"
    assert "'Seg3'" in str(caught.value)
    toolpath = read(path, options=ReadOptions(task="Seg2"))
    np.testing.assert_allclose(toolpath.points[0], [1.93086049, -0.4823883637, 2.002981023])
    np.testing.assert_allclose(np.degrees(toolpath.joints[0, 0]), -16.76016827)
