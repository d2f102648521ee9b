"""Where the tests find what lies outside their own folders."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FIXTURES = ROOT / "fixtures"
PANEL = FIXTURES / "drilling_panel"
PANEL_CELL = PANEL / "cell.toml"
SHARED = ROOT.parent / "shared"
"""Real files of other makers, beside the checkout where they are at hand."""
SNAPSHOTS = Path(os.environ.get("POSTPROC_SNAPSHOTS", SHARED / "snapshots"))
"""Checkouts of public repositories, each in a folder ``OWNER+NAME``: see CONTRIBUTING."""


def snapshot(repository):
    """The checkout of a public repository; the test is skipped where there is none."""
    folder = SNAPSHOTS / repository.replace("/", "+")
    if not folder.is_dir():
        pytest.skip(f"no checkout of {repository} in {SNAPSHOTS} (POSTPROC_SNAPSHOTS)")
    return folder
