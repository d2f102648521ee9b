"""Reading TOML with its line numbers, and writing it."""

from postproc.toml.edit import edited
from postproc.toml.text import Location, TomlText, load_toml, parse_toml
from postproc.toml.write import toml_key, toml_table, toml_value
