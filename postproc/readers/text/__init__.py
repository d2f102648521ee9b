"""Text input at speed: blocks, numbers, spans, collected faults."""

from postproc.readers.text.blocks import (
    AS_CSV,
    TextBlock,
    check_line_length,
    check_text,
    last_line_end,
    line_feeds,
    text_blocks,
)
from postproc.readers.text.decimals import LARGEST, parse_number, parse_tokens, trim_end, trim_start
from postproc.readers.text.faults import Faults, shortened
