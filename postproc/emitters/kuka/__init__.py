"""Plan to KUKA KRL."""

from postproc.emitters.kuka import emitter
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.emitters.kuka.style import KrlStyle

__all__ = [
    "KrlStyle",
    "emit",
    "emitter",
    "render_files",
]
