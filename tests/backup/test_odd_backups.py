"""Odd backups of real workshops: other folders, other letters, files that are absent or double."""

import pytest

from postproc.backup import read_backup
from postproc.errors import ReadError
from tests.backup import archives
from tests.backup.test_backup import BASES, TOOLS, cell_of, contents, frame_of

R1 = "KRC/R1/"
CONFIG = R1 + "System/$config.dat"
MACHINE = R1 + "Mada/$machine.dat"


def zipped(folder, files):
    path = folder / "backup.zip"
    path.write_bytes(archives.zipped(files))
    return path


@pytest.mark.parametrize(
    "change",
    [
        lambda name: name.replace("KRC/", "C/KRC/ROBOTER/KRC/"),
        lambda name: name.replace("KRC/R1", "krc/r1").replace("Mada", "MADA"),
        lambda name: name.replace("System", "SYSTEM").replace("$config", "$CONFIG"),
        lambda name: name.replace("KRC/R1/Mada/$machine.dat", "KRC/R1/MaDa/$Machine.DAT"),
        lambda name: f"Archiv Zelle 3 (Süd)/{name}",
        lambda name: f"./{name}",
    ],
)
def test_folders_of_other_names_and_cases(change, tmp_path):
    found = read_backup(zipped(tmp_path, {change(k): v for k, v in contents().items()}))
    assert [tool.number for tool in found.tools] == list(TOOLS)
    assert found.homes


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "cp1250", "utf-16"])
@pytest.mark.parametrize("ends", ["\r\n", "\n", "\r"])
def test_encodings_and_line_ends(encoding, ends, tmp_path):
    names = {("TOOL", 1): "Fräser_größe", ("BASE", 3): "Süd"}
    files = contents(names=names)
    for name in (CONFIG, MACHINE):
        files[name] = files[name].decode("utf-8").replace("\r\n", ends).encode(encoding)
    found = read_backup(zipped(tmp_path, files))
    assert [tool.frame for tool in found.tools] == list(TOOLS.values())
    assert found.tools[0].name == names["TOOL", 1]
    assert found.bases[0].name == names["BASE", 3]


def test_without_config_the_arm_alone_is_known(tmp_path, capsys):
    files = contents()
    del files[CONFIG]
    cell, data, text, err = cell_of(tmp_path, files, capsys)
    assert "tools" not in data
    assert "bases" not in data
    assert data["robot"]["model"] == "kuka_kr500_r2800_2"
    assert "no R1/System/$config.dat" in err
    assert "no XHOME" in text
    assert cell.tools


def test_the_config_of_the_submit_side_is_never_taken(tmp_path):
    files = contents()
    files["KRC/STEU/System/$config.dat"] = archives.config({9: TOOLS[9]}, {}).encode()
    files["KRC/STEU/$config.dat"] = archives.config({8: TOOLS[8]}, {}).encode()
    assert [t.number for t in read_backup(zipped(tmp_path, files)).tools] == list(TOOLS)


def test_two_robots_are_named(tmp_path):
    both = {**contents(), **{k.replace("KRC/R1", "KRC2/R1"): v for k, v in contents().items()}}
    with pytest.raises(ReadError, match=r"BAK006.*2 robots") as caught:
        read_backup(zipped(tmp_path, both))
    assert "KRC2/R1/Mada/$machine.dat" in caught.value.message
    folder = archives.unpacked(tmp_path / "both", both)
    assert len(read_backup(folder / "KRC2").tools) == 16


def test_arrays_that_a_program_fills_in_a_loop(tmp_path, capsys):
    """The data list says what was stored last; that programs write all of it is a remark."""
    config = archives.config({1: TOOLS[1]}, BASES)
    config = config.replace(
        "DECL FRAME TOOL_DATA[16]", "DECL FRAME TOOL_DATA[MAX_TOOL] ; set by INIT_TOOLS"
    )
    program = (
        "DEF INIT_TOOLS( )\r\nDECL INT n\r\nFOR n=1 TO MAX_TOOL\r\n"
        "  TOOL_DATA[n]=xStored[n]\r\nENDFOR\r\nEND\r\n"
    )
    files = archives.files(archives.machine(), config)
    files[R1 + "Program/init_tools.src"] = program.encode()
    _, data, text, _ = cell_of(tmp_path, files, capsys)
    assert [frame_of(tool) for tool in data["tools"]] == [list(TOOLS[1])]
    assert "programs of the controller assign TOOL_DATA[any]" in " ".join(text.split())


def test_tools_that_stand_in_the_room_are_no_workpieces(tmp_path, capsys):
    kinds = {("BASE", 3): "#TCP", ("TOOL", 2): "#TCP"}
    _, data, text, _ = cell_of(tmp_path, contents(kinds=kinds), capsys)
    assert [base["number"] for base in data["bases"]] == [32]
    assert 2 not in [tool["number"] for tool in data["tools"]]
    said = " ".join(text.replace("\n#", " ").split())
    assert "a tool that stands in the room (#TCP)" in said
    assert "a workpiece on the flange (#TCP)" in said


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("#KR500R2800_2 C4 FLR", "kuka_kr500_r2800_2"),
        ("#KR500R2800-2 S C5 CLG", "kuka_kr500_r2800_2"),
        ("KR 500 R2800-2", "kuka_kr500_r2800_2"),
        ("#ROBOTER 7 HALLE SÜD", "kuka_kr500_r2800_2"),
        ("", "kuka_kr500_r2800_2"),
        ("#" * 32, "kuka_kr500_r2800_2"),
    ],
)
def test_custom_names_of_a_known_arm(name, model, tmp_path, capsys):
    _, data, _, _ = cell_of(tmp_path, contents(archives.machine(name)), capsys)
    assert data["robot"]["model"] == model


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("TOOL_DATA[3]={X 30.0", "TOOL_DATA[3]={FRAME: X 30.0"),
        ("TOOL_DATA[3]={X 30.0,Y -9.75", "TOOL_DATA[3]={Y -9.75,X 30"),
        ("TOOL_DATA[3]={X 30.0", "TOOL_DATA[ 3 ] = {X 3.0E+01"),
        ("TOOL_DATA[3]={X 30.0", "tool_data[3]={x 30.0"),
        ("TOOL_DATA[3]={X 30.0", "DECL GLOBAL FRAME OTHER={X 1.0}\r\nTOOL_DATA[3]={X 30.0"),
    ],
)
def test_other_ways_to_write_a_frame(old, new, tmp_path):
    files = contents()
    text = files[CONFIG].decode()
    assert old in text
    files[CONFIG] = text.replace(old, new).encode()
    (third,) = [t for t in read_backup(zipped(tmp_path, files)).tools if t.number == 3]
    assert third.frame == TOOLS[3]


def test_the_last_of_two_values_is_the_one_that_stands(tmp_path):
    files = contents()
    again = archives.frame((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    files[CONFIG] = files[CONFIG].replace(b";ENDFOLD", f"TOOL_DATA[3]={again}".encode())
    (third,) = [t for t in read_backup(zipped(tmp_path, files)).tools if t.number == 3]
    assert third.frame == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize("software", ["V4.1.7 SP08", "V5.6.12", "V8.7.3", "V8.7 HF1", "V9.2.1"])
def test_generations_make_the_round_trip(software, tmp_path, capsys):
    """KRC2, KRC4 and KRC5 archives with sixteen tools: every number comes back."""
    files = contents(lower=software < "V8")
    files["am.ini"] = files["am.ini"].replace(b"V8.6.5", software.encode())
    _, data, text, _ = cell_of(tmp_path, files, capsys)
    assert [frame_of(tool) for tool in data["tools"]] == [list(f) for f in TOOLS.values()]
    assert f"system software {software}" in text
