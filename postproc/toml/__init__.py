"""Reading TOML with its line numbers, and writing it."""
