"""The effect library: every module here is one effect, found by the registry."""
