"""What records a path: every module here reads one format, found by the registry."""
