"""What the shell completes: commands, options, and the names that a user would have to look up."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

from postproc.cell import robot_names
from postproc.cli.app import group
from postproc.gap import EFFECTS


def completed(*words):
    """Return what is offered for the last of these words."""
    *before, last = words
    shell = ShellComplete(group, {}, "postproc", "_POSTPROC_COMPLETE")
    return [item.value for item in shell.get_completions(before, last)]


def test_robots():
    assert "kuka_kr500_r2830" in completed("robots", "kuka_kr5")
    assert set(completed("new-cell", "--robot", "")) == set(robot_names())
    assert completed("robots", "nobody") == []


def test_effects_and_codes():
    assert completed("explain", "thermal") == ["thermal_drift"]
    assert set(completed("explain", "")) >= {name for name, _ in EFFECTS}
    assert "APT010" in completed("explain", "apt01")
    assert "joint_limit" in completed("explain", "joint_l")


def test_parts():
    assert completed("convert", "--format", "a") == ["auto", "apt"]
    assert completed("convert", "--emitter", "") == ["kuka_krl"]
    for command in ("convert", "batch"):
        assert "axial" in completed(command, "--objective", "a")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_the_shell(shell):
    variables = {**os.environ, "_POSTPROC_COMPLETE": f"{shell}_source"}
    command = Path(sys.executable).with_name("postproc")
    if not command.exists():
        pytest.skip("postproc is not installed as a command")
    done = subprocess.run([command], env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "_POSTPROC_COMPLETE" in done.stdout
