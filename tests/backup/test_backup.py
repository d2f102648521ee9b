"""Backups of controllers: what a cell takes over from them, and where both differ."""

import json
import tomllib

import numpy as np
import pytest

from postproc.backup import read_backup
from postproc.cell import load_cell
from postproc.cli import app
from postproc.errors import ReadError
from postproc.geometry import transform_from_kuka
from postproc.units import DEG, MM
from tests.backup import archives
from tests.places import SHARED

MADE = SHARED / "real" / "krc" / "made"
TOOLS = {n: (10.0 * n, -3.25 * n, 200.0 + n, 12.5, -90.0 + n, 0.5 * n) for n in range(1, 17)}
BASES = {3: (1500.0, -20.5, 600.0, 10.0, 0.25, -0.125), 32: (900.0, 0.0, 700.0, 0.0, 0.0, 180.0)}


def run(capsys, *arguments):
    code = app.run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def cell_of(tmp_path, contents, capsys, *more):
    """The cell made from an archive, loaded, and its table as written."""
    archive = tmp_path / "backup.zip"
    archive.write_bytes(archives.zipped(contents))
    path = tmp_path / "cell.toml"
    code, _, err = run(capsys, "new-cell", "--backup", archive, "-o", path, "--force", *more)
    assert code == 0, err
    return load_cell(path), tomllib.loads(path.read_text("utf-8")), path.read_text("utf-8"), err


def contents(machine=None, tools=TOOLS, bases=BASES, **config):
    return archives.files(machine or archives.machine(), archives.config(tools, bases, **config))


def frame_of(table):
    return [*table["frame"]["xyz_mm"], *table["frame"]["abc_deg"]]


def test_sixteen_tools_make_the_round_trip(tmp_path, capsys):
    names = {("TOOL", n): f"tool number {n}" for n in TOOLS} | {("BASE", 3): "Tisch_Süd"}
    loads = {n: (20.0 + n, (1.5, -2.0, 90.0 + n)) for n in TOOLS if n % 2}
    cell, data, _, _ = cell_of(tmp_path, contents(names=names, loads=loads), capsys)
    assert data["robot"]["model"] == "kuka_kr500_r2800_2"
    assert {t["number"]: frame_of(t) for t in data["tools"]} == {
        n: list(f) for n, f in TOOLS.items()
    }
    assert [t["name"] for t in data["tools"]] == [names["TOOL", n] for n in TOOLS]
    assert {t["number"]: t["mass_kg"] for t in data["tools"] if "mass_kg" in t} == {
        n: mass for n, (mass, _) in loads.items()
    }
    assert [t["cog_mm"] for t in data["tools"] if "cog_mm" in t] == [
        list(c) for _, c in loads.values()
    ]
    assert {b["number"]: frame_of(b) for b in data["bases"]} == {
        n: list(f) for n, f in BASES.items()
    }
    assert data["bases"][0]["name"] == "Tisch_Süd"
    assert data["robot"]["limits_deg"] == [list(map(float, pair)) for pair in archives.LIMITS]
    assert data["robot"]["speed_deg_s"] == [90.0] * 6
    assert data["motion"]["home_deg"] == list(archives.HOME)
    for n, tool in zip(TOOLS, cell.tools, strict=True):
        wanted = transform_from_kuka(TOOLS[n][:3], TOOLS[n][3:])
        np.testing.assert_allclose(tool.T_flange_tcp, wanted, atol=1e-12)
    code, out, _ = run(capsys, "check", cell.path, "--backup", tmp_path / "backup.zip", "--json")
    document = json.loads(out)
    assert (code, document["backup"]["differences"]) == (0, [])
    assert document["backup"]["compared"] > 150
    assert {f["code"] for f in document["findings"]} >= {"CEL142"}


@pytest.mark.parametrize("name", ["kr500_krc4", "kr210_krc2_style"])
@pytest.mark.parametrize("as_zip", [False, True])
def test_archives_with_known_truth(name, as_zip, tmp_path, capsys):
    if not MADE.is_dir():
        pytest.skip("the archives are not beside the checkout")
    truth = json.loads((MADE / "TRUTH.json").read_text())[name]
    source = MADE / name
    if as_zip:
        files = {
            path.relative_to(source).as_posix(): path.read_bytes()
            for path in source.rglob("*")
            if path.is_file()
        }
        source = tmp_path / "a.zip"
        source.write_bytes(archives.zipped({f"{name}/{key}": text for key, text in files.items()}))
    path = tmp_path / "cell.toml"
    assert run(capsys, "new-cell", "--backup", source, "-o", path)[0] == 0
    cell, data = load_cell(path), tomllib.loads(path.read_text("utf-8"))
    assert cell.robot.name == truth["model"]
    for key, entries in (("tools", cell.tools), ("bases", cell.bases)):
        assert {str(entry.number) for entry in entries} == set(truth[key])
        for entry in entries:
            xyzabc = truth[key][str(entry.number)]
            T = entry.T_flange_tcp if key == "tools" else entry.T_robroot_base
            wanted = transform_from_kuka(xyzabc[:3], xyzabc[3:])
            np.testing.assert_allclose(T[:3, :3], wanted[:3, :3], atol=1e-9)
            # the files hold IEEE single
            np.testing.assert_allclose(T[:3, 3] / MM, xyzabc[:3], rtol=1e-6, atol=1e-9)
    for table in data["tools"]:
        said = truth["names"][str(table["number"])].strip()
        assert table["name"] == (said or f"tool_{table['number']}")
        mass, cog = truth["loads"].get(str(table["number"]), (None, None))
        assert (table.get("mass_kg"), table.get("cog_mm")) == (mass, cog)
    np.testing.assert_allclose(cell.robot.q_min / DEG, [low for low, _ in truth["soft"]])
    np.testing.assert_allclose(cell.robot.q_max / DEG, [high for _, high in truth["soft"]])
    np.testing.assert_allclose(cell.motion.home / DEG, truth["home"])
    code, out, _ = run(capsys, "check", path, "--backup", source, "--json")
    assert code == 0
    assert json.loads(out)["backup"]["differences"] == []


def test_old_controllers_write_lower_case_and_another_code_page(tmp_path, capsys):
    config = archives.config(
        TOOLS, BASES, names={("TOOL", 1): "Fräser   ", ("TOOL", 2): "Me\x81\x8dßer"}, lower=True
    )
    raw = archives.files(archives.machine(), config)
    raw["KRC/R1/System/$config.dat"] = config.encode("latin-1")
    _, data, _, _ = cell_of(tmp_path, raw, capsys)
    assert [frame_of(t) for t in data["tools"]] == [list(f) for f in TOOLS.values()]
    assert data["tools"][0]["name"] == "Fräser"
    assert data["tools"][1]["name"] == "Me\ufffd\ufffdßer"
    raw["KRC/R1/System/$config.dat"] = config.encode("utf-16")
    assert len(cell_of(tmp_path, raw, capsys)[1]["tools"]) == 16


@pytest.mark.parametrize("inside", ["", "KRC", "KRC/R1", ".."])
def test_a_folder_may_be_pointed_at_anywhere(tmp_path, inside):
    folder = archives.unpacked(tmp_path / "outer" / "backup", contents())
    assert len(read_backup(folder / inside).tools) == 16


def test_archives_of_other_tools(tmp_path):
    for number, change in enumerate((lambda n: n.replace("/", "\\"), str.upper)):
        path = tmp_path / f"{number}.zip"
        path.write_bytes(archives.zipped({change(k): v for k, v in contents().items()}))
        assert len(read_backup(path).tools) == 16


def test_krcdiag_and_a_bare_r1(tmp_path):
    plain = contents()
    del plain["am.ini"]
    plain["KRCDiag.log"] = b""
    renamed = {name.replace("KRC/", "Files/KRC/Roboter/KRC/", 1): v for name, v in plain.items()}
    (tmp_path / "diag.zip").write_bytes(archives.zipped(renamed))
    assert len(read_backup(tmp_path / "diag.zip").tools) == 16
    bare = {k.removeprefix("KRC/R1/"): v for k, v in plain.items() if k.startswith("KRC/R1/")}
    assert len(read_backup(archives.unpacked(tmp_path / "robot one", bare)).tools) == 16


def test_unused_numbers_are_left_out_and_special_ones_are_remarks(tmp_path, capsys):
    kinds = {("TOOL", 2): "#TCP", ("BASE", 32): "#TCP", ("TOOL", 5): "#BASE"}
    tools = {1: TOOLS[1], 2: TOOLS[2]}
    extra = ['MACHINE_FRAME_DAT[3]={MACH_DEF_INDEX 2,PARENT[] "DKP400",GEOMETRY[] "ObjectId = -1"}']
    _, data, text, _ = cell_of(
        tmp_path, contents(tools=tools, kinds=kinds, names={("TOOL", 7): "flange"}, extra=extra),
        capsys,
    )  # fmt: skip
    assert [t["number"] for t in data["tools"]] == [1, 5, 7]
    assert "bases" not in data
    assert "left out: TOOL 2" in text
    assert "a tool that stands in the room" in text
    assert "hangs on the kinematic DKP400" in text


def test_a_turned_root_moves_the_bases_into_the_robot_root(tmp_path, capsys):
    root = (100.0, -50.0, 400.0, 90.0, 0.0, 180.0)
    cell, data, _, _ = cell_of(tmp_path, contents(archives.machine(root=root)), capsys)
    T_world_root = transform_from_kuka(root[:3], root[3:])
    np.testing.assert_allclose(cell.robot.T_world_robroot, T_world_root, atol=1e-12)
    for base in cell.bases:
        frame = BASES[base.number]
        found = T_world_root @ base.T_robroot_base
        np.testing.assert_allclose(found, transform_from_kuka(frame[:3], frame[3:]), atol=1e-9)
    assert data["robot"]["base"]["xyz_mm"] == [100.0, -50.0, 400.0]


def test_soft_limits_are_never_wider_than_the_arm(tmp_path, capsys):
    wide = archives.machine().replace("$SOFTN_END[2]=-130", "$SOFTN_END[2]=-160")
    wide = wide.replace("$SOFTP_END[2]=5", "$SOFTP_END[2]=140")
    cell, _, text, _ = cell_of(tmp_path, contents(wide), capsys)
    np.testing.assert_allclose([cell.robot.q_min[1] / DEG, cell.robot.q_max[1] / DEG], [-130, 5])
    assert "A2: the controller allows -160 to 140, wider than the arm" in text


@pytest.mark.parametrize(
    ("name", "changes", "model"),
    [
        ("#KR500R2800_2 C5 FLR", {}, "kuka_kr500_r2800_2"),
        ("#MY_OWN_NAME", {}, "kuka_kr500_r2800_2"),
        ("#KR210R2700_2 C4 FLR", {}, None),
        ("#KR500R2800_2 C4 FLR", {"LENGTH_B": 1251.0}, None),
        ("#KR999R5000 C5 FLR", {"LENGTH_A": 777.0}, None),
    ],
)
def test_lengths_decide_which_arm_it_is(name, changes, model, tmp_path, capsys):
    cell, data, _, _ = cell_of(tmp_path, contents(archives.machine(name, **changes)), capsys)
    assert data["robot"].get("model") == model
    if model is None:
        sizes = data["robot"]["dimensions_mm"]
        assert sizes["c2"] == changes.get("LENGTH_B", 1250.0)
        assert sizes["a1"] == changes.get("LENGTH_A", 500.0)
        assert (sizes["a2"], sizes["c1"], sizes["c3"], sizes["c4"]) == (
            -150.0,
            800.0,
            1039.5,
            286.0,
        )
        assert cell.robot.geometry.c2 == pytest.approx(sizes["c2"] * MM)


def test_several_arms_of_the_same_lengths_are_told_by_name(tmp_path, capsys):
    text = archives.machine("#KR70R2100 C5 FLR", LENGTH_A=175.0, LENGTH_B=890.0)
    for old, new in (
        ("Z 800", "Z 575"),
        ("Z 286", "Z 185"),
        ("X 1039.5", "X 1035"),
        ("Z 150", "Z 50"),
    ):
        text = text.replace(old, new)
    _, data, _, _ = cell_of(tmp_path, contents(text), capsys)
    assert data["robot"]["model"] == "kuka_kr70_r2100"
    _, data, _, _ = cell_of(tmp_path, contents(text.replace("KR70", "KX70")), capsys)
    assert data["robot"]["dimensions_mm"]["c1"] == 575.0


def test_files_of_two_robots_are_reported(tmp_path, capsys):
    robcor = (
        'DEFDAT $ROBCOR PUBLIC\n$MODEL_NAME[]="#KR30L16_3A C4 FLR"\n$DYN_DAT[12]=815.0\nENDDAT\n'
    )
    mixed = {**contents(), "KRC/R1/Mada/$robcor.dat": robcor.encode()}
    _, _, text, err = cell_of(tmp_path, mixed, capsys)
    assert "two robots" in err
    assert "two robots" in " ".join(text.split())


def test_data_that_programs_assign_are_named(tmp_path, capsys):
    program = (
        "DEF JOB( )\n; TOOL_DATA[4]={X 1.0}\nTOOL_DATA[11] = TOOL_DATA[2]\n"
        "IF TOOL_DATA[5]==x THEN\nENDIF\nBASE_DATA[nBase].X=3.0\nEND\n"
    )
    job = {**contents(), "KRC/R1/Program/job.src": program.encode()}
    archive = tmp_path / "a.zip"
    archive.write_bytes(archives.zipped(job))
    assert read_backup(archive).rewritten == ("BASE_DATA[any]", "TOOL_DATA[11]")
    assert "programs of the controller assign TOOL_DATA[11]" in cell_of(tmp_path, job, capsys)[2]


@pytest.mark.parametrize(
    ("said", "kss"),
    [("V5.6.5 SP08", "5"), ("V8.3.20", "8.3"), ("V8.4.1", "8.3"), ("V8.5.9", "8.5"),
     ("V8.6.5.268", "8.6"), ("V8.7.1", "8.7"), ("V9.2.0", "8.7"), ("V4.1.7 SP08", "5")],
)  # fmt: skip
def test_the_system_software_decides_the_forms(said, kss, tmp_path, capsys):
    files = contents(tools={})
    files["am.ini"] = files["am.ini"].replace(b"V8.6.5", said.encode())
    assert cell_of(tmp_path, files, capsys)[1]["krl"]["kss"] == kss


def test_differences_of_cell_and_controller(tmp_path, capsys):
    cell, _, text, _ = cell_of(tmp_path, contents(loads={1: (50.0, (0.0, 0.0, 100.0))}), capsys)
    changed = text.replace("-3.25, 201.0", "-3.25, 201.1", 1).replace("148.0]", "149.0]")
    changed = changed.replace("mass_kg = 50.0", "mass_kg = 40.0").replace(
        "number = 32", "number = 31"
    )
    (tmp_path / "cell.toml").write_text(changed, encoding="utf-8")
    code, out, _ = run(capsys, "check", cell.path, "--backup", tmp_path / "backup.zip", "--json")
    found = {d["key"]: d for d in json.loads(out)["backup"]["differences"]}
    assert code == 1
    assert set(found) == {
        "tools[1].frame", "tools[1].mass_kg", "robot.limits_deg[1]", "BASE_DATA[31]", "bases[32]",
    }  # fmt: skip
    assert found["tools[1].frame"]["cell"][2] == pytest.approx(201.1)
    assert found["tools[1].frame"]["controller"][2] == pytest.approx(201.0)
    assert found["robot.limits_deg[1]"]["severity"] == "error"
    assert found["bases[32]"]["severity"] == "note"
    narrow = text.replace("148.0]", "140.0]")
    (tmp_path / "cell.toml").write_text(narrow, encoding="utf-8")
    assert run(capsys, "check", cell.path, "--backup", tmp_path / "backup.zip")[0] == 0


def test_another_home_and_arm_are_differences(tmp_path, capsys):
    """Where programs go to XHOME by its name the home of the controller counts."""
    text = archives.machine()
    cell, data, _, _ = cell_of(tmp_path, contents(text), capsys)
    assert data["krl"]["home"] == "xhome"
    homes = {**contents(text)}
    key = next(name for name, content in homes.items() if b"XHOME={" in content)
    a2 = f"A2 {data['motion']['home_deg'][1]:.1f}".encode()
    assert a2 in homes[key]
    homes[key] = homes[key].replace(a2, b"A2 -60.5", 1)
    archive = tmp_path / "moved.zip"
    archive.write_bytes(archives.zipped(homes))
    code, out, _ = run(capsys, "check", cell.path, "--backup", archive, "--json")
    found = {d["key"]: d for d in json.loads(out)["backup"]["differences"]}
    assert code == 1
    assert set(found) == {"motion.home_deg"}
    assert found["motion.home_deg"]["controller"][1] == -60.5
    by_axes = (tmp_path / "cell.toml").read_text().replace('home = "xhome"', 'home = "axes"')
    (tmp_path / "cell.toml").write_text(by_axes, encoding="utf-8")
    code, out, _ = run(capsys, "check", cell.path, "--backup", archive, "--json")
    (one,) = json.loads(out)["backup"]["differences"]
    assert (code, one["severity"]) == (0, "note")
    model = data["robot"]["model"]
    other = by_axes.replace(f'model = "{model}"', 'model = "kuka_kr500_r2830"')
    assert other != by_axes
    (tmp_path / "cell.toml").write_text(other, encoding="utf-8")
    code, out, _ = run(capsys, "check", cell.path, "--backup", archive, "--json")
    assert "robot.model" in {d["key"] for d in json.loads(out)["backup"]["differences"]}


def test_frames_are_compared_as_rotations(tmp_path, capsys):
    """At B = 90 the same turn has many A and C."""
    cell, _, text, _ = cell_of(
        tmp_path, contents(tools={1: (1.0, 2.0, 3.0, 30.0, 90.0, 10.0)}), capsys
    )
    other = text.replace("[30.0, 90.0, 10.0]", "[50.0, 90.0, 30.0]")
    assert other != text
    (tmp_path / "cell.toml").write_text(other, encoding="utf-8")
    assert run(capsys, "check", cell.path, "--backup", tmp_path / "backup.zip")[0] == 0


def test_a_tool_without_an_axis_is_refused_by_the_job_that_uses_it(tmp_path, capsys):
    tools, bases = {1: TOOLS[1], 2: TOOLS[2]}, {3: BASES[3]}
    cell, _, text, _ = cell_of(tmp_path, contents(tools=tools, bases=bases), capsys)
    arguments = ("convert", tmp_path / "holes.csv", "--cell", cell.path, "-o", tmp_path / "out")
    assert run(capsys, "check", cell.path)[0] == 0
    claimed = text.replace("number = 1 ", 'cam = ["1"]\nnumber = 1 ').replace("# cam = ...", "#", 1)
    (tmp_path / "cell.toml").write_text(claimed, encoding="utf-8")
    (tmp_path / "holes.csv").write_text("id,x,y,z,i,j,k,depth,tool\nH1,0,0,0,0,0,1,5,1\n")
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert "error CEL031: tool 1" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("$MAIN_AXIS=#NR", "$MAIN_AXIS=#SS"), "$MAIN_AXIS is #SS"),
        (("$WRIST_AXIS=#ZEH", "$WRIST_AXIS=#WIH"), "$WRIST_AXIS is #WIH"),
        (("$TRAFO_AXIS=6", "$TRAFO_AXIS=5"), "expected 6"),
        (("REAL $LENGTH_A=500.0", ""), "$LENGTH_A is missing"),
        (("B 90", "B 80"), "turn or shift"),
        (("INT $EX_AX_NUM=0", "BOOL $DEF_A4FIX=TRUE"), "$DEF_A4FIX is set"),
    ],
)
def test_other_arms_are_refused(change, words, tmp_path):
    text = archives.machine()
    assert change[0] in text
    (tmp_path / "a.zip").write_bytes(archives.zipped(contents(text.replace(*change))))
    with pytest.raises(ReadError) as caught:
        read_backup(tmp_path / "a.zip")
    assert caught.value.code == "BAK007"
    assert words in caught.value.message
