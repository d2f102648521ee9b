"""What pages are put together from."""

from postproc.report.parts.charts import Series, bar_chart, line_chart, shaded_view, space_view
from postproc.report.parts.glance import doubt, how_far, where_joint, where_place, where_time, which
from postproc.report.parts.headline import headline
from postproc.report.parts.page import (
    Page,
    escape,
    finding_rows,
    first_rows,
    packed,
    packed_text,
    table,
)
from postproc.report.parts.rows_view import RowsView, add_rows, colour_html, list_html
from postproc.report.parts.scene_data import (
    Drawing,
    Solid,
    T_world_base,
    axes_in_drawn_base,
    extent_of,
    in_drawn_base,
    scene_data,
)
from postproc.report.parts.spin_map_picture import CLASS_COLOURS, CLASS_WORDS, Picture, draw
from postproc.report.parts.tag_values import TagColumn, tag_columns
from postproc.report.parts.texts import ProgramText, cam_lines, unix_text
