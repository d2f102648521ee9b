"""Run a bench: ``python -m tools.bench NAME ...``; each has a ``--help``."""

from __future__ import annotations

import sys
from importlib import import_module

NAMES = (
    "ablation",
    "agreement",
    "batch",
    "collision",
    "contours",
    "executed",
    "holes",
    "kinematics",
    "krl",
    "margins",
    "page",
    "planning",
    "readers",
    "steady",
)
"""Modules beside this one; ``tesseract.py`` runs in an interpreter of its own."""


def main() -> None:
    """Hand the further words to the bench that the first one names."""
    if len(sys.argv) < 2 or sys.argv[1] not in NAMES:
        raise SystemExit(f"usage: python -m tools.bench {{{','.join(NAMES)}}} ...")
    name = sys.argv.pop(1)
    sys.argv[0] = f"python -m tools.bench {name}"
    import_module(f"tools.bench.{name}").main()


if __name__ == "__main__":
    main()
