"""KRL as data: program type, numbers, rendering, parsing, linting, splitting."""
