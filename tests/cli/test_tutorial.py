"""The README, followed as a new user would: every command of the tutorial runs and is good."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(kind):
    return re.search(rf"^```{kind}\n(.*?)^```", README, re.DOTALL | re.MULTILINE).group(1)


def call(words, folder):
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, capture_output=True, text=True, check=False
    )


def test_every_command_of_the_tutorial(tmp_path):
    (tmp_path / "holes.csv").write_text(block("csv"))
    commands = block("sh tutorial").strip().splitlines()
    assert len(commands) >= 6
    for line in commands:
        done = call(shlex.split(line), tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        assert "Traceback" not in done.stderr
    for name in ("cell.html", "out/holes.src", "out/holes.dat", "out/holes.html"):
        assert (tmp_path / name).stat().st_size > 0
    assert (tmp_path / "holes.csv").read_text().count("\n") == 13


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shell_completion(shell, tmp_path):
    variables = {**os.environ, "_POSTPROC_COMPLETE": f"{shell}_source"}
    command = Path(sys.executable).with_name("postproc")
    if not command.exists():
        pytest.skip("postproc is not installed as a command")
    done = subprocess.run([command], env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "_POSTPROC_COMPLETE" in done.stdout


def test_links_of_the_readme_are_there():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target


def test_files_that_the_readme_names_are_there():
    for name in re.findall(r"`((?:docs|tests|tools)/[\w./]+)`", README):
        assert (ROOT / name).exists(), name


def test_options_that_the_readme_names_exist(tmp_path):
    """Every postproc line of the README names a command and options that it has."""
    helps = {}
    for line in re.findall(r"^postproc .*$", README, re.MULTILINE):
        words = shlex.split(line.split("  #")[0])
        name = words[1]
        if name not in helps:
            helps[name] = call(["postproc", name, "--help"], tmp_path).stdout
        for option in (word for word in words if word.startswith("--")):
            assert option in helps[name], line
