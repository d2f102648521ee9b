"""A plan to the program text of one controller."""

from postproc.emitters.base import EMITTERS, Emitter
from postproc.emitters.kuka import emit, render_files

__all__ = [
    "EMITTERS",
    "Emitter",
    "emit",
    "render_files",
]
