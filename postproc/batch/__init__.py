"""Many inputs: parallel, resumable, checkable."""
