"""Plan to KUKA KRL."""

from postproc.emitters.kuka import emitter
from postproc.emitters.kuka.emitter import emit, render_files

__all__ = [
    "emit",
    "emitter",
    "render_files",
]
