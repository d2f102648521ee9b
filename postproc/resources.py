"""Where the files that travel with the package lie, installed or in a checkout."""

from __future__ import annotations

from pathlib import Path


def templates_folder() -> Path:
    """Return the folder of the built-in templates: inside the wheel, else the checkout's."""
    package = Path(__file__).resolve().parent
    installed = package / "_templates"
    return installed if installed.is_dir() else package.parent / "templates"
