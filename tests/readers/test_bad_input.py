"""Every kind of bad input: one clear line with its code, exit 2, no output, no traceback."""

import json
import re
import time

import pytest

from postproc.cli.app import run
from postproc.errors import PluginError, ReadError
from postproc.readers import READERS, ReadOptions, read
from postproc.registry import PluginInfo

ENDLESS = 20.0
"""Bad input that costs more processor time [s] has no bound (the usual is 0.1)."""
MM = "UNITS/MM\n"
NX = "TOOL PATH/A,TOOL,B\n"
CSV = "x,y,z,i,j,k\n"
XML = "<OLPData><Resource id='r'>{}</Resource></OLPData>"
MOTION = (
    "<Activity ActivityType='DNBRobotMotionActivity' Operation='O' id='1'><MotionAttributes>"
    "<MotionType>{kind}</MotionType></MotionAttributes><Target><CartesianTarget>"
    "<Position Units='{unit}' X='{x}' Y='0' Z='0'/>"
    "<Orientation Units='deg' Yaw='0' Pitch='0' Roll='0'/></CartesianTarget></Target></Activity>"
)
TARGET = MOTION.format(kind="Linear", unit="m", x="1")
CALL = "<Activity ActivityType='DNBIgpCallRobotTask' id='2'><CallName>{}</CallName></Activity>"


def task(name: str, *content: str) -> str:
    return f"<ActivityList Task='{name}'>{''.join(content)}</ActivityList>"


LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY lol "lol">'
    + "".join(
        f'<!ENTITY lol{i} "{f"&lol{i - 1 if i > 1 else str()};" * 10}">' for i in range(1, 10)
    )
    + "]><OLPData>&lol9;</OLPData>"
)

HOLE = MM + "CYCLE/DRILL,FEDTO,5,RAPTO,2\nGOTO/1,0,0\n"
FED = NX + "FEDRAT/MMPM,9\nGOTO/1,0,0\n"


def moving(kind: str = "Linear", unit: str = "m", x: str = "1") -> str:
    return XML.format(task("A", MOTION.format(kind=kind, unit=unit, x=x)))


TABLE = [
    # name, content, code, words of the message
    ("empty.apt", "", "IO011", "empty file"),
    ("blank.apt", " \n\n\t\r\n", "IO011", "empty file"),
    ("nul.apt", "UNITS/MM\nGOTO/1,2,3\0\nFINI\n", "IO012", "NUL byte"),
    ("utf16.apt", "GOTO/1,2,3\n".encode("utf-16"), "IO012", "UTF-16"),
    ("binary.stl", bytes(range(256)) * 40, "IO012", "NUL byte"),
    ("letter.txt", "Dear all,\nplease find enclosed\n", "IO010", "none of the formats"),
    ("png.csv", b"\x89PNG\r\n\x1a\nxxxx", "IO010", "nothing in it looks like csv"),
    ("part.stp", "ISO-10303-21;\nHEADER;\n", "IO010", "a STEP solid"),
    ("text.stl", "solid x\nendsolid\n", "IO010", "an STL solid"),
    ("p.src", "&ACCESS RVP\r\n&REL 1\r\nDEF p( )\r\nEND\r\n", "IO010", "a KUKA program"),
    ("p.dxf", "  0\nSECTION\n  2\nHEADER\n", "IO010", "a DXF drawing"),
    ("p.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0\0", "IO012", "(.xls)"),
    ("p.xlsx", b"PK\3\4\0\0[Content_Types].xml", "IO012", "(.xlsx)"),
    ("p.ods", b"PK\3\4\0\0mimetypeapplication/vnd.oasis", "IO012", "(.ods)"),
    ("p.nc", "%\nO1\nG41 D1\nM30\n", "IO010", "looks like gcode"),
    ("long.apt", "UNITS/MM\nGOTO/" + "1" * 300_000 + "\nFINI\n", "IO015", "a line of more than"),
    ("longnumber.apt", MM + "GOTO/" + "1" * 3000 + ",2,3\nFINI\n", "APT022", "number"),
    ("nomotion.apt", MM + "FEDRAT/100\nFINI\n", "IO014", "no motion"),
    ("units.apt", "FEDRAT/100\nGOTO/1,2,3\nFINI\n", "APT010", "no unit of length"),
    ("unit.apt", "UNITS/FURLONG\nGOTO/1,2,3\nFINI\n", "APT012", "unknown unit"),
    ("units2.apt", MM + "GOTO/1,2,3\nUNITS/INCH\nGOTO/1,2,3\nFINI\n", "APT013", "read in mm"),
    ("cut.apt", MM + "GOTO/1,2,3\nGOTO/4,5,6\n", "APT009", "cut off"),
    ("cut.cls", NX + "FEDRAT/MMPM,9\nGOTO/1,2,3\nGOTO/4,5,6\n", "APT009", "END-OF-PATH"),
    ("cutline.apt", MM + "GOTO/1,2,3\nGOTO/4,5", "APT023", "2 numbers"),
    ("dollar.apt", MM + "GOTO/1,2,$\n", "APT006", "continued"),
    ("nan.apt", MM + "GOTO/nan,0,0\nFINI\n", "APT022", "number"),
    ("inf.apt", MM + "GOTO/1,inf,0\nFINI\n", "APT022", "number"),
    ("huge.apt", MM + "GOTO/1e308,0,0\nFINI\n", "APT022", "at most 1e9"),
    ("larger.apt", MM + "GOTO/1e999,0,0\nFINI\n", "APT022", "number"),
    ("four.apt", MM + "GOTO/1,2,3,4\nFINI\n", "APT023", "4 numbers"),
    ("emptyfield.apt", MM + "GOTO/1,,3\nFINI\n", "APT022", "number"),
    ("trailing.apt", MM + "GOTO/1,2,3,\nFINI\n", "APT020", "empty field"),
    ("comma.apt", MM + "GOTO/1,2 3\nFINI\n", "APT021", "comma"),
    ("zeroaxis.apt", MM + "GOTO/1,2,3,0,0,0\nFINI\n", "APT026", "zero vector"),
    ("longaxis.apt", MM + "GOTO/1,2,3,0,0,1.5\nFINI\n", "APT027", "length 1.5"),
    ("nearend.apt", MM + "GOTO/1,2,3\nFIN\n", "APT005", "is it FINI"),
    ("noslash.apt", MM + "GOTO 1,2,3\nFINI\n", "APT005", "GOTO"),
    ("numbers.apt", MM + "GOTO/1,2,3\n4,5,6\nFINI\n", "APT003", "without a word"),
    ("feed0.apt", MM + "FEDRAT/100\nGOTO/1,2,3\nFEDRAT/0\nFINI\n", "APT052", "above zero"),
    ("nofeed.apt", MM + "FEDRAT/100\nFEDRAT/\nFINI\n", "APT050", "no number"),
    ("feedword.apt", MM + "FEDRAT/100,PARSEC\nFINI\n", "APT051", "PARSEC"),
    ("twoarcs.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nCIRCLE/0,0,0,0,0,1\nGOTO/0,1,0\nFINI\n",
     "APT035", "two arcs"),
    ("twoarcsend.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nCIRCLE/0,0,0,0,0,1\nFINI\n",
     "APT035", "two arcs"),
    ("arcend.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nFINI\n", "APT030", "no end point"),
    ("arcstart.apt", MM + "CIRCLE/0,0,0,0,0,1\nGOTO/1,0,0\nFINI\n", "APT036", "no point before"),
    ("arcplane.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,0\nGOTO/0,1,0\nFINI\n", "APT037", "plane"),
    ("arcradius.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,2,0\nFINI\n", "APT038",
     "one circle"),
    ("arcshort.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0\nGOTO/0,1,0\nFINI\n", "APT032", "4 numbers"),
    ("times.apt", MM + "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1,1,TIMES,X\nGOTO/0,1,0\nFINI\n", "APT031",
     "turns"),
    ("arccycle.apt", HOLE + "CIRCLE/0,0,0,0,0,1\nGOTO/0,1,0\nFINI\n", "APT039", "drill cycle"),
    ("delta.apt", MM + "GODLTA/1,2,3\nFINI\n", "APT025", "no point before"),
    ("nodepth.apt", MM + "CYCLE/DRILL,RAPTO,2\nGOTO/1,0,0\nFINI\n", "APT046", "without a depth"),
    ("upwards.cls", NX + "CYCLE/DRILL,FEDTO,5.,RAPTO,2.,MMPM,9.\nGOTO/1,0,0\nEND-OF-PATH\n",
     "APT047", "above the hole"),
    ("movarc.apt", MM + "GOTO/1,0,0\nMOVARC/0,0,0,0,0,1,1\nGOTO/0,1,0\nFINI\n", "APT084", "ANGLE"),
    ("sweep.apt", MM + "GOTO/1,0,0\nMOVARC/0,0,0,0,0,1,1,ANGLE,80\nGOTO/0,1,0\nFINI\n",
     "APT085", "80.0000 deg"),
    ("rise.apt", MM + "GOTO/1,0,0\nARCSLP/2\nMOVARC/CENTER,0,0,0,AXIS,0,0,1,RADIUS,1\nGOTO/0,1,0\n"
     "FINI\n", "APT086", "rise of 2.0000 mm"),
    ("plane.apt", MM + "GOTO/1,0,0\nINDIRP/1,1,0\nTLON,GOFWD/(CIRCLE/CANON,0,0,0,0,0,1,1),ON,"
     "(PLANE/1,0,0,5)\nFINI\n", "APT087", "does not meet"),
    ("cycleon.apt", MM + "CYCLE/ON,FEDTO,5\nGOTO/1,0,0\nFINI\n", "APT040", "no cycle before"),
    ("cyclenum.apt", MM + "CYCLE/DRILL,FEDTO,RAPTO,2\nGOTO/1,0,0\nFINI\n", "APT043", "no number"),
    ("siemens.apt", MM + "CYCLE81/10,0\nGOTO/1,0,0\nFINI\n", "APT041", "RTP"),
    ("tool.apt", MM + "LOAD/TOOL\nGOTO/1,0,0\nFINI\n", "APT070", "tool number"),
    ("msys.cls", NX + "MSYS/0,0,0,1,0,0,1,0,0\nFEDRAT/MMPM,9\nGOTO/1,0,0\nEND-OF-PATH\n", "APT063",
     "right angles"),
    ("msysshort.cls", NX + "MSYS/0,0,0,1,0,0\nFEDRAT/MMPM,9\nGOTO/1,0,0\nEND-OF-PATH\n", "APT062",
     "9 numbers"),
    ("matrix.aptsource", "$$*CATIA0\n$$ A\n$$ 1 0 0 0\nFEDRAT/9,MMPM\nGOTO/1,0,0\nEND\n", "APT064",
     "3x4 matrix"),
    ("knot.cls", FED + "KNOT/1\nEND-OF-PATH\n", "APT080", "without NURBS"),
    ("nurbs.cls", FED + "NURBS/\nKNOT/1,.5\nCNTRL/1,2,3\nEND-OF-PATH\n",
     "APT082", "make no NURBS"),
    ("width.csv", CSV + "1,2,3,0,0,1\n1,2,3,0,0\n", "CSV003", "5 fields, expected 6"),
    ("text.csv", CSV + "1,2,3,0,0,1\n1,abc,3,0,0,1\n", "CSV004", "y needs a number"),
    ("nan.csv", CSV + "1,nan,3,0,0,1\n4,5,6,0,0,1\n", "CSV004", "nan"),
    ("inf.csv", CSV + "1,-inf,3,0,0,1\n4,5,6,0,0,1\n", "CSV004", "inf"),
    ("huge.csv", CSV + "1,1e308,3,0,0,1\n4,5,6,0,0,1\n", "CSV004", "at most 1e9"),
    ("emptyx.csv", CSV + "1,2,3,0,0,1\n,5,6,0,0,1\n", "CSV005", "x is empty"),
    ("headeronly.csv", "x,y,z,i,j,k\n", "CSV002", "no row of data"),
    ("noy.csv", "x,z,i,j,k\n1,2,0,0,1\n", "CSV010", "no column y"),
    ("twice.csv", "x,y,z,x,i,j,k\n1,2,3,4,0,0,1\n", "CSV014", "two columns for x"),
    ("seven.csv", "1,2,3,4,5,6,7\n1,2,3,4,5,6,7\n", "CSV013", "7 columns"),
    ("points.csv", "x,y,z,i,j\n1,2,3,0,0\n", "CSV020", "only i,j of an orientation"),
    ("zero.csv", CSV + "1,2,3,0,0,0\n", "CSV021", "zero vector"),
    ("angles.csv", "1,2,3,180,0,90\n1,2,3,10,20,30\n", "CSV023", "length 201"),
    ("both.csv", "x,y,z,i,j,k,a,b,c\n1,2,3,0,0,1,0,0,0\n", "CSV024", "two orientations"),
    ("depth.csv", "x,y,z,i,j,k,depth\n1,2,3,0,0,1,-5\n", "CSV030", "depth of -5"),
    ("feed.csv", "x,y,z,i,j,k,feed\n1,2,3,0,0,1,0\n", "CSV034", "above zero"),
    ("motion.csv", "x,y,z,i,j,k,motion\n1,2,3,0,0,1,warp\n", "CSV031", "unknown motion"),
    ("names.csv", "id,x,y,z,i,j,k\nA,1,2,3,0,0,1\nA,9,2,3,0,0,1\n", "CSV040", "8.000 mm apart"),
    ("laughs.xml", LAUGHS, "DEL002", "document type"),
    ("external.xml", "<!DOCTYPE a SYSTEM 'http://127.0.0.1:9/a.dtd'><OLPData/>", "DEL002",
     "document type"),
    ("broken.xml", "<OLPData><Resource></OLPData>", "DEL001", "well-formed"),
    ("cut.xml", XML.format(task("A", TARGET))[:-30], "DEL001", "well-formed"),
    ("other.xml", "<svg><path/></svg>", "DEL003", "svg"),
    ("deep.xml", "<OLPData>" + "<a>" * 5000 + "</a>" * 5000 + "</OLPData>", "DEL001", "depth"),
    ("number.xml", moving(x="1e999"), "DEL004",
     "number"),
    ("unit.xml", moving(unit="ly"), "DEL004",
     "Units"),
    ("kind.xml", moving(kind="Warp"), "DEL017",
     "MotionType"),
    ("circular.xml", moving(kind="Circular"), "DEL018",
     "CircularVia"),
    ("via.xml", moving(kind="CircularVia"), "DEL019",
     "without a Circular"),
    ("call.xml", XML.format(task("A", CALL.format("B"))), "DEL010", "is not in the file"),
    ("ring.xml", XML.format(task("A", CALL.format("B")) + task("B", CALL.format("A"))), "DEL011",
     "circle"),
    ("self.xml", XML.format(task("M", CALL.format("A")) + task("A", CALL.format("A"))), "DEL011",
     "circle"),
    ("bomb.xml", XML.format("".join(task(f"T{i}", CALL.format(f"T{i + 1}") * 10) for i in range(20))
                            + task("T20", TARGET)), "DEL012", "more than"),
    ("target.xml", XML.format(task("A", TARGET.replace("<CartesianTarget>", "<Tag>").replace(
        "</CartesianTarget>", "</Tag>"))), "DEL005", "without"),
    ("joint.xml", XML.format(task("A", TARGET.replace(
        "</CartesianTarget>", "</CartesianTarget><JointTarget><Joint Units='deg'><JointValue>1"
        "</JointValue></Joint></JointTarget>"))), "DEL005", "Joint without DOFNumber"),
    ("twice.xml", XML.format(task("A", TARGET) + task("A", TARGET)), "DEL015", "two tasks"),
    ("robots.xml", "<OLPData>" + "".join(
        f"<Resource id='{r}'><GeneralInfo><ResourceName>{r}</ResourceName></GeneralInfo>"
        f"{task(r, TARGET)}</Resource>" for r in "ab") + "</OLPData>", "DEL014", "two robots"),
    ("notasks.xml", "<OLPData><Resource id='r'/></OLPData>", "IO014", "no motion"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "code", "words"), TABLE, ids=[row[0] for row in TABLE])
def test_one_clear_line(name, content, code, words, tmp_path, capsys):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode("latin-1"))
    start = time.process_time()
    assert run(["inspect", str(path), "--json"]) == 2
    assert time.process_time() - start < ENDLESS
    out, err = capsys.readouterr()
    assert json.loads(out)["code"] == code
    first = err.splitlines()[0]
    assert re.fullmatch(rf"{re.escape(str(path))}:\d+: error {code}: .+", first), first
    assert words in first
    assert "Traceback" not in err
    assert len(first) < 400


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["missing.apt"], "IO001"),
        (["."], "IO002"),
        (["x.csv", "--format", "step"], "CLI001"),
        (["x.csv", "--columns", "x,y"], "CSV012"),
        (["x.csv", "--columns", "x,y,z,i,j,wobble"], "CSV011"),
        (["x.csv", "--cycle-words", "depth,colour"], "IO021"),
        (["p.apt", "--dialect", "fanuc"], "APT090"),
        (["p.apt", "--units", "inch"], "APT013"),
        (["t.xml", "--task", "Nope"], "DEL013"),
    ],
)
def test_wrong_calls(arguments, code, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.csv").write_text(CSV + "1,2,3,0,0,1\n")
    (tmp_path / "p.apt").write_text(MM + "GOTO/1,2,3\nFINI\n")
    (tmp_path / "t.xml").write_text(XML.format(task("A", TARGET)))
    assert run(["inspect", *arguments]) == 2
    assert f"error {code}:" in capsys.readouterr().err.splitlines()[0]


@pytest.mark.parametrize(
    ("name", "head", "unit", "code"),
    [
        ("line.apt", b"GOTO/", b"1,", "IO015"),
        ("row.csv", b"", b"1,", "IO015"),
        ("letters.txt", b"", b"A", "IO010"),
        ("one.xml", b"<OLPData>", b"<a/>", "DEL006"),
        ("text.xml", b"<OLPData>", b"a ", "DEL006"),
    ],
)
def test_a_single_line_without_end(name, head, unit, code, tmp_path, capsys):
    """No reader waits for the end of the line: 100 MB here stand for any length."""
    path = tmp_path / name
    with path.open("wb") as stream:
        stream.write(head)
        for _ in range(100):
            stream.write(unit * (1_000_000 // len(unit)))
    start = time.process_time()
    assert run(["inspect", str(path)]) == 2
    assert time.process_time() - start < ENDLESS
    assert f"error {code}:" in capsys.readouterr().err.splitlines()[0]


def test_a_gigabyte_of_nothing(tmp_path, capsys):
    path = tmp_path / "sparse.apt"
    with path.open("wb") as stream:
        stream.truncate(1 << 30)
    assert run(["inspect", str(path)]) == 2
    assert "error IO012:" in capsys.readouterr().err


def test_a_list_without_normals_can_be_looked_at_but_not_read(tmp_path, capsys):
    path = tmp_path / "points.csv"
    path.write_text("1,2,3\n4,5,6\n")
    assert run(["inspect", str(path), "--json"]) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert (document["points"], document["tool_axes"]) == (2, 0)
    assert "warning CSV112: no orientation" in err
    with pytest.raises(ReadError, match="CSV020"):
        read(str(path))


def test_a_foreign_reader_that_fails_stops_nobody_elses_file(tmp_path, monkeypatch):
    class Failing:
        def sniff(self, head):
            raise KeyError("head")

        def read(self, path, options):
            raise KeyError("read")

    list(READERS)
    monkeypatch.setitem(READERS._parts, "failing", Failing())
    info = PluginInfo("readers", "failing", "their-package", "1.0")
    monkeypatch.setattr(READERS, "_infos", [*READERS._infos, info])
    path = tmp_path / "part.csv"
    path.write_text(CSV + "0,0,0,0,0,1\n5,0,0,0,0,1\n")
    toolpath = read(path)
    assert toolpath.format == "csv"
    assert [finding.code for finding in toolpath.warnings][:1] == ["PLG007"]
    assert "reader 'failing' of their-package 1.0 failed: KeyError" in toolpath.warnings[0].message
    with pytest.raises(PluginError, match=r"PLG006: reader .failing. of their-package 1\.0 failed"):
        read(path, ReadOptions(format="failing"))
