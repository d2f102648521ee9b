"""The commands ``robots`` and ``plugins``."""

import json

import pytest

from postproc.cli import app
from postproc.registry import PluginInfo, Registry


def run(arguments, capsys):
    code = app.run(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_table_names_all_robots_and_what_is_assumed(capsys):
    code, out, err = run(["robots"], capsys)
    assert (code, err) == (0, "")
    rows = {line.split()[0]: line for line in out.splitlines()[1:]}
    assert len(rows) >= 150
    assert "2826.5" in rows["kuka_kr500_r2830"]
    assert "speed A4-A6" in rows["kuka_kr500_r2830"]
    assert "600" in rows["kuka_kr600_r2830"].split()
    assert "no speed" in rows["kuka_kr16_3"]


def test_one_robot_as_json(capsys):
    code, out, err = run(["robots", "kuka_kr500_r2830", "--json"], capsys)
    robot = json.loads(out)
    assert (code, err) == (0, "")
    assert robot["dimensions_mm"]["c2"] == 1300.0
    assert robot["limits_deg"][1] == [-130.0, 20.0]
    assert robot["speed_deg_s"][:3] == [90.0, 80.0, 75.0]
    kinds = [source["provenance"] for source in robot["sources"]["speed_deg_s"]]
    assert kinds == ["published"] * 3 + ["assumed"] * 3
    assert robot["sources"]["dimensions_mm"]["a2"]["source"]
    numbers = {key for key, value in robot.items() if value is not None}
    words = {"schema", "name", "title", "trust", "doubts", "reach_mm", "sources"}
    assert numbers - words == set(robot["sources"])
    assert robot["sources"]["joint_stiffness_Nmm_per_rad"][0]["provenance"] == "published"


def test_one_robot_for_people_names_each_source(capsys):
    code, out, _ = run(["robots", "kuka_kr6_r900_2"], capsys)
    assert code == 0
    assert "A2: -190, 45" in out
    assert "[1] published: KUKA's ROS 2 packages" in out


def test_list_as_json(capsys):
    code, out, _ = run(["robots", "--json"], capsys)
    robots = json.loads(out)["robots"]
    assert code == 0
    assert [robot["name"] for robot in robots] == sorted(robot["name"] for robot in robots)
    assert all(robot["payload_kg"] > 0 for robot in robots)


def test_arms_that_reach_and_carry_enough(capsys):
    code, out, _ = run(["robots", "--reach", "3000", "--payload", "500", "--json"], capsys)
    robots = json.loads(out)["robots"]
    assert code == 0
    assert {"kuka_kr510_r3080", "kuka_kr560_r3100_2"} <= {robot["name"] for robot in robots}
    assert all(robot["reach_mm"] >= 3000 and robot["payload_kg"] >= 500 for robot in robots)


def test_unknown_name_says_which_is_nearest(capsys):
    code, out, err = run(["robots", "kuka_kr500_r2380", "--json"], capsys)
    assert (code, json.loads(out)["schema"]) == (2, "postproc.error/1")
    assert err.splitlines()[0].endswith("the nearest is 'kuka_kr500_r2830'")
    assert "error CEL010" in err.splitlines()[0]


def test_plugins_of_all_four_kinds(capsys):
    code, out, err = run(["plugins", "--json"], capsys)
    plugins = json.loads(out)["plugins"]
    assert (code, err) == (0, "")
    found = {(plugin["group"], plugin["name"]) for plugin in plugins}
    assert {
        ("readers", "apt"),
        ("emitters", "kuka_krl"),
        ("effects", "joint_compliance"),
        ("objectives", "axial"),
    } <= found
    assert all(plugin["origin"] == "built-in" and plugin["version"] for plugin in plugins)


def test_a_broken_plugin_is_listed_with_its_cause(capsys, monkeypatch):
    broken = PluginInfo("effects", "mine", "my-package", "1.2", "ImportError: no module x")
    whole = Registry.infos
    monkeypatch.setattr(
        Registry, "infos", lambda self: (*whole(self), *([broken] * (self.group == "effects")))
    )
    code, out, err = run(["plugins"], capsys)
    assert code == 0
    assert "mine" in out
    assert "ImportError: no module x" in out
    assert "effect 'mine' of my-package 1.2 cannot be used: ImportError: no module x" in err


@pytest.mark.parametrize("command", [["robots"], ["plugins"]])
def test_quiet_says_nothing(command, capsys):
    assert run([*command, "--quiet"], capsys) == (0, "", "")
