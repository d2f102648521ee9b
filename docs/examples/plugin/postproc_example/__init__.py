"""Example plug-ins of postproc: a reader, an effect, an emitter, an objective."""
