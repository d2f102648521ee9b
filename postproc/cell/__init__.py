"""The robot cell: file, schema, robot data."""
