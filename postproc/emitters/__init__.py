"""A plan to the program text of one controller, chosen by name, and the check of this text."""

from postproc.emitters.base import EMITTERS, Against, Emitter, Program, ReadBack
from postproc.emitters.check import (
    differences,
    emit,
    emitter_of,
    is_checkable,
    motions_of,
    read_back,
    written,
)
from postproc.emitters.former import Former, former_parts
