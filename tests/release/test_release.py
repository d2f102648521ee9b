"""What is released beside the code: constraints, GitHub Action, pre-commit hooks, image."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from postproc.cli import app
from postproc.version import __version__
from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CASE = ROOT / "fixtures" / "trim_5axis"


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A repository with a committed program, as the tutorial of CI makes one."""
    folder = tmp_path_factory.mktemp("repository")
    (folder / "parts").mkdir()
    shutil.copy(CASE / "trim.cls", folder / "parts")
    shutil.copy(CASE / "cell.toml", folder)
    here = Path.cwd()
    os.chdir(folder)
    try:
        words = ["batch", "parts/", "--cell", "cell.toml", "-o", "programs", "--jobs", "1"]
        assert app.run([*words, "--quiet"]) == 0
    finally:
        os.chdir(here)
    return folder


@pytest.fixture
def shell(tmp_path):
    """A function that runs a line in a folder, with ``postproc`` of this environment."""
    command = tmp_path / "bin" / "postproc"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m postproc "$@"\n')
    command.chmod(0o755)

    def run(line, folder, **variables):
        path = os.pathsep.join([str(command.parent), os.environ["PATH"]])
        environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), **variables}
        done = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", line],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr

    return run


def edited(repository, tmp_path):
    """Return a copy of the repository whose committed program somebody has edited."""
    copy = tmp_path / "edited"
    shutil.copytree(repository, copy)
    program = copy / "programs" / "trim.src"
    text = program.read_bytes()
    assert b"Z -5.0000,A 90" in text
    program.write_bytes(text.replace(b"Z -5.0000,A 90", b"Z -4.9700,A 90", 1))
    return copy


def action_steps():
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    defaults = {key: str(value.get("default", "")) for key, value in action["inputs"].items()}
    return defaults, {step["name"]: step for step in action["runs"]["steps"] if "run" in step}


@pytest.mark.slow
@pytest.mark.parametrize("changed", [False, True])
def test_the_action(changed, repository, tmp_path, shell):
    folder = edited(repository, tmp_path) if changed else repository
    defaults, steps = action_steps()
    values = defaults | {"inputs": "parts/", "cell": "cell.toml", "programs": "programs"}
    values |= {"junit": str(tmp_path / "checks.xml"), "options": "--jobs 1", "before": ""}
    codes, summary = {}, tmp_path / "summary.md"
    where = {"RUNNER_TEMP": str(tmp_path), "GITHUB_STEP_SUMMARY": str(summary)}
    for name in ("check", "lint", "diff"):
        variables = {
            key: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda m: values[m.group(1)], text)
            for key, text in steps[name]["env"].items()
        }
        codes[name], told = shell(steps[name]["run"], folder, **variables, **where)
        assert "Traceback" not in told
    assert codes == {"check": int(changed), "lint": 0, "diff": 0}
    assert ("different: " in summary.read_text()) == changed
    assert ("::notice title=" in told) == changed
    assert (tmp_path / "postproc" / "made.html").exists()
    assert (tmp_path / "checks.xml").exists()


@pytest.mark.slow
@pytest.mark.parametrize("changed", [False, True])
def test_the_hooks(changed, repository, tmp_path, shell):
    folder = edited(repository, tmp_path) if changed else repository
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    entries = {hook["id"]: hook for hook in hooks}
    lint, check = entries["postproc-lint"], entries["postproc-batch-check"]
    assert re.search(lint["files"], "programs/trim.src")
    assert shell(f"{lint['entry']} programs/trim.src programs/trim.dat", folder)[0] == 0
    arguments = "parts/ --cell cell.toml -o programs --jobs 1"
    assert check["pass_filenames"] is False
    assert shell(f"{check['entry']} {arguments}", folder)[0] == int(changed)


def test_every_dependency_has_a_tested_version():
    lines = (ROOT / "constraints.txt").read_text(encoding="ascii").splitlines()
    tested = {
        canonicalize_name(name): Version(version)
        for name, _, version in (line.partition("==") for line in lines if "==" in line)
    }
    wanted = [*PROJECT["dependencies"], *chain(*PROJECT["optional-dependencies"].values())]
    for requirement in map(Requirement, wanted):
        name = canonicalize_name(requirement.name)
        if name != "postproc":
            assert name in tested, f"{name}: see CONTRIBUTING, Release"
            assert requirement.specifier.contains(tested[name]), requirement


def test_the_changelog_has_this_version_with_its_date():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## {re.escape(__version__)} \(\d{{4}}-\d\d-\d\d\)$", text, re.MULTILINE)
    first = re.search(
        rf"^## {re.escape(__version__)}.*?^### (.*?)$", text, re.DOTALL | re.MULTILINE
    )
    assert first.group(1) == "Changes emitted programs"


def test_a_version_of_the_changelog_can_be_read_in_one_go():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
    assert {v.split()[0]: len(v.split()) for v in versions if len(v.split()) > 1500} == {}


def test_the_image_copies_what_there_is():
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    copied = re.findall(r"^COPY (?!--from)(.*) \S+$", text, re.MULTILINE)
    names = [name for line in copied for name in line.split()]
    assert {"pyproject.toml", "postproc", "templates", "constraints.txt"} <= set(names)
    for name in names:
        assert (ROOT / name).exists(), name
