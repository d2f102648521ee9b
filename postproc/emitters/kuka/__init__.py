"""Plan to KUKA KRL."""

from postproc.emitters.kuka import emitter

__all__ = ["emitter"]
