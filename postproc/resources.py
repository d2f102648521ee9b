"""Where the files that travel with the package lie, installed or in a checkout."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def templates_folder() -> Path:
    """Return the folder of the built-in templates: inside the wheel, else the checkout's."""
    installed = _PACKAGE / "_templates"
    return installed if installed.is_dir() else _PACKAGE.parent / "templates"


def glossary_file() -> Path:
    """Return the glossary of the documentation: inside the wheel, else the checkout's."""
    installed = _PACKAGE / "_glossary.md"
    return installed if installed.exists() else _PACKAGE.parent / "docs" / "glossary.md"
