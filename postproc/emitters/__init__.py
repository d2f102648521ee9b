"""A plan to the program text of one controller."""

from postproc.emitters.base import EMITTERS, Emitter
from postproc.emitters.kuka import KrlStyle, emit, render_files

__all__ = [
    "EMITTERS",
    "Emitter",
    "KrlStyle",
    "emit",
    "render_files",
]
