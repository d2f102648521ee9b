"""The ways between the tags: connections, detours, cuts, strokes and their speeds."""
