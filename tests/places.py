"""Where the tests find what lies outside their own folders."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIXTURES = ROOT / "fixtures"
PANEL = FIXTURES / "drilling_panel"
PANEL_CELL = PANEL / "cell.toml"
SHARED = ROOT.parent / "shared"
"""Real files of other makers, beside the checkout where they are at hand."""
