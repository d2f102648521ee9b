"""Reading TOML with its line numbers, and writing it."""

from postproc.toml.edit import edited, toml_key, toml_table, toml_value
from postproc.toml.text import Location, TomlText, load_toml, parse_toml
