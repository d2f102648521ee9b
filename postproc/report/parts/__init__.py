"""What pages are put together from."""

from postproc.report.parts.headline import headline
from postproc.report.parts.page import Page, escape, packed, packed_text, table
from postproc.report.parts.program_text import ProgramText, program_text
from postproc.report.parts.rows_view import RowsView, add_rows
from postproc.report.parts.scene_data import T_world_base, add_scene
from postproc.report.parts.spin_map_picture import CLASS_WORDS, Picture, draw
from postproc.report.parts.svg import Series, bar_chart, line_chart, space_view
from postproc.report.parts.tag_values import TagColumn, moves_of_tags, tag_columns
from postproc.report.parts.texts import cam_lines, unix_text

__all__ = [
    "CLASS_WORDS",
    "Page",
    "Picture",
    "ProgramText",
    "RowsView",
    "Series",
    "T_world_base",
    "TagColumn",
    "add_rows",
    "add_scene",
    "bar_chart",
    "cam_lines",
    "draw",
    "escape",
    "headline",
    "line_chart",
    "moves_of_tags",
    "packed",
    "packed_text",
    "program_text",
    "space_view",
    "table",
    "tag_columns",
    "unix_text",
]
