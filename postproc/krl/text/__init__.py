"""KRL as text: lexer, parser, the program as data, and its rendering."""

from postproc.krl.text.expression import (
    Binary,
    FunctionCall,
    Node,
    Reference,
    Structure,
    Unary,
    names_in,
    nodes_in,
    parse_expression,
)
from postproc.krl.text.flow import Flow, flow_of
from postproc.krl.text.lexer import KrlSyntaxError, tokenise
from postproc.krl.text.literals import components, pose_or_axes, table_of
from postproc.krl.text.names import NameAllocator, comment_text, legal_name
from postproc.krl.text.parse import load_modules, parse_files, parse_module, require_sound
from postproc.krl.text.program import (
    BRANCHES,
    CLOSERS,
    FIELDS,
    LOOPS,
    OPENERS,
    Aggregate,
    Assign,
    Axes,
    Blank,
    Call,
    Comment,
    Continue,
    Control,
    DataList,
    Declaration,
    Enum,
    Expr,
    External,
    FoldBegin,
    FoldEnd,
    Halt,
    Interrupt,
    KrlModule,
    Move,
    MoveWord,
    Parameter,
    Pose,
    Raw,
    Routine,
    SplineBegin,
    SplineEnd,
    Statement,
    Text,
    Trigger,
    Value,
    Variable,
    WaitFor,
    WaitSec,
)
from postproc.krl.text.render import render, render_statement, value_text
from postproc.krl.text.source import LONG_LINE, TextFacts, text_of
from postproc.krl.text.split import NO_BORDER, Part, split, suffixes
from postproc.names import KEYWORDS, NAME_LENGTH, is_legal
