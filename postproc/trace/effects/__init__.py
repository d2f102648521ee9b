"""The effects along a path: every module here is one effect, found by the registry."""
