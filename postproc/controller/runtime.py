"""Values while a program runs: expressions, frames, structures, variables.

What cannot be known without the controller (inputs, timers, names of other modules) is ``UNKNOWN``
and stays so through every formula; nothing is guessed here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from postproc import krl
from postproc.arrays import FloatArray
from postproc.geometry import inverse, kuka_from_transform, transform_from_kuka
from postproc.units import DEG


class _Unknown:
    """The value of what only the controller knows."""

    def __repr__(self) -> str:
        return "UNKNOWN"

    def __bool__(self) -> bool:
        return False


UNKNOWN = _Unknown()
Indices = tuple[int, ...]
Point = TypeVar("Point", krl.Pose, krl.Axes)
_HELD: dict[str, tuple[type, ...]] = {
    "BOOL": (bool,),
    "CHAR": (krl.Text,),
    **dict.fromkeys(("POS", "E6POS", "FRAME"), (krl.Pose, krl.Aggregate)),
    **dict.fromkeys(("AXIS", "E6AXIS"), (krl.Axes, krl.Aggregate)),
}
"""What variables of these types hold; an aggregate is one of which not all is known."""
_DEGREES: dict[str, Callable[[float], float]] = {
    "SIN": lambda a: math.sin(a * DEG),
    "COS": lambda a: math.cos(a * DEG),
    "TAN": lambda a: math.tan(a * DEG),
    "ACOS": lambda a: math.acos(a) / DEG,
    "ASIN": lambda a: math.asin(a) / DEG,
    "ATAN": lambda a: math.atan(a) / DEG,
    "SQRT": math.sqrt,
    "ABS": abs,
}
_ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "==": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "B_AND": lambda a, b: a & b,
    "B_OR": lambda a, b: a | b,
    "B_EXOR": lambda a, b: a ^ b,
    "EXOR": lambda a, b: bool(a) != bool(b),
}


class Variables:
    """Storage of one scope: plain values and array elements by name in upper case."""

    __slots__ = ("arrays", "plain", "types")

    def __init__(self) -> None:
        self.plain: dict[str, Any] = {}
        self.arrays: dict[str, dict[Indices, Any]] = {}
        self.types: dict[str, str] = {}
        """Declared types in upper case; undeclared parameters and points of the pad have none."""

    def __contains__(self, name: str) -> bool:
        """Whether the scope holds this name."""
        return name in self.plain or name in self.arrays


class Evaluator:
    """Computes expressions.

    Args:
        lookup: returns the scope that holds a name, or None.
        system: returns the value of a system variable by canonical name (``$OUT[3]``).
        call: runs a function of the program or of the controller; None if it is not known.
    """

    def __init__(
        self,
        lookup: Callable[[str], Variables | None],
        system: Callable[[str], Any],
        call: Callable[[str, tuple[krl.Node | None, ...]], Any],
    ) -> None:
        self._lookup = lookup
        self._system = system
        self._call = call

    def value(self, value: krl.Value | None) -> Any:  # noqa: ANN401 - KRL values are of many types
        """Return what a value of the program type stands for."""
        if isinstance(value, krl.Expr):
            return self.node(krl.parse_expression(value.text))
        if isinstance(value, krl.Aggregate):
            fields = tuple((name, self.value(item)) for name, item in value.fields)
            return _structure(value.type_name, fields)
        return UNKNOWN if value is None else value

    def node(self, node: krl.Node) -> Any:  # noqa: ANN401 - as above
        """Return the value of an expression tree."""
        if isinstance(node, krl.Reference):
            return self._reference(node)
        if isinstance(node, krl.Binary):
            return self._binary(node)
        if isinstance(node, krl.Unary):
            return _unary(node.operator, self.node(node.operand))
        if isinstance(node, krl.FunctionCall):
            return self._function(node)
        if isinstance(node, krl.Structure):
            return _structure(
                node.type_name, tuple((name, self.node(item)) for name, item in node.fields)
            )
        return self.value(node)

    def key(self, node: krl.Reference) -> str | None:
        """Return a reference as canonical text with its indices computed; None if unknown."""
        text = node.name
        for selector in node.selectors:
            if isinstance(selector, str):
                text += f".{selector}"
                continue
            indices = self.indices(selector)
            if indices is None:
                return None
            text += "[" + ",".join(str(index) for index in indices) + "]"
        return text

    def indices(self, selector: tuple[krl.Node, ...]) -> Indices | None:
        """Return the indices of an array element; None if one is unknown."""
        values = [self.node(item) for item in selector]
        if any(isinstance(v, bool) or not isinstance(v, int) for v in values):
            return None
        return tuple(values)

    def _reference(self, node: krl.Reference) -> Any:  # noqa: ANN401
        if node.name.startswith("$"):
            key = self.key(node)
            return UNKNOWN if key is None else self._system(key)
        scope = self._lookup(node.name)
        if scope is None:
            return UNKNOWN
        value: Any = scope.plain.get(node.name, UNKNOWN)
        for selector in node.selectors:
            if isinstance(selector, str):
                value = component(value, selector)
            else:
                indices = self.indices(selector)
                elements = scope.arrays.get(node.name, {})
                value = UNKNOWN if indices is None else elements.get(indices, UNKNOWN)
        return value

    def _binary(self, node: krl.Binary) -> Any:  # noqa: ANN401
        left = self.node(node.left)
        if node.operator == "AND" and left is False:
            return False
        if node.operator == "OR" and left is True:
            return True
        right = self.node(node.right)
        if left is UNKNOWN or right is UNKNOWN:
            decides = {"AND": False, "OR": True}.get(node.operator)
            return decides if decides is not None and right is decides else UNKNOWN
        if node.operator == ":":
            return frame_product(left, right)
        return _arithmetic(node.operator, left, right)

    def _function(self, node: krl.FunctionCall) -> Any:  # noqa: ANN401
        name = node.name.upper()
        if name in _DEGREES or name in ("ATAN2", "INV_POS", "INV"):
            arguments = [UNKNOWN if a is None else self.node(a) for a in node.arguments]
            return _builtin(name, arguments)
        return self._call(node.name, node.arguments)


def component(value: Any, name: str) -> Any:  # noqa: ANN401
    """Return a component of a structure, ``UNKNOWN`` if there is none."""
    if isinstance(value, krl.Pose | krl.Axes):
        if len(name) == 2 and name[0] == "E":
            number = int(name[1]) if name[1].isdigit() else 0
            return value.external[number - 1] if 0 < number <= len(value.external) else UNKNOWN
        fields = krl.FIELDS[type(value)]
        found = getattr(value, fields[name]) if name in fields else None
        return UNKNOWN if found is None else found
    if isinstance(value, krl.Aggregate):
        found = value.get(name)
        return UNKNOWN if found is None else found
    return UNKNOWN


def with_component(value: Any, path: tuple[str, ...], new: Any) -> Any:  # noqa: ANN401
    """Return a structure with one component (of a component ...) replaced."""
    if not path:
        return new
    name, rest = path[0], path[1:]
    inner = with_component(component(value, name), rest, new)
    is_number = isinstance(inner, int | float) and not isinstance(inner, bool)
    if isinstance(value, krl.Pose | krl.Axes) and not is_number:
        return UNKNOWN
    if isinstance(value, krl.Pose | krl.Axes) and name in krl.FIELDS[type(value)]:
        return replace(value, **{krl.FIELDS[type(value)][name]: inner})
    if isinstance(value, krl.Pose | krl.Axes) and name in {f"E{i}" for i in range(1, 7)}:
        external = list(value.external) + [0.0] * max(0, int(name[1]) - len(value.external))
        external[int(name[1]) - 1] = inner
        return replace(value, external=tuple(external))
    fields = list(value.fields) if isinstance(value, krl.Aggregate) else []
    kept = [(key, item) for key, item in fields if key.upper() != name]
    return _structure("", (*kept, (name, inner)))


def converted(value: Any, type_name: str) -> Any:  # noqa: ANN401
    """Return a KRL value as a variable of a declared type takes it, None where it does not."""
    if value is UNKNOWN or not type_name:
        return value
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if type_name in ("INT", "REAL"):
        whole = type_name == "INT"
        return None if not is_number else _whole(value) if whole else float(value)
    if type_name == "CHAR" and is_number:
        return UNKNOWN  # the code of a character: which one moves no arm
    if type_name in _HELD:
        return value if isinstance(value, _HELD[type_name]) else None
    # an enumeration or a structure of any name, and none of the values of the other types
    return None if is_number or isinstance(value, bool | krl.Text) else value


def _whole(value: float) -> int | None:
    """Return the number as an INT: KRL rounds a REAL to the nearest one, halves away from zero."""
    if not abs(value) < 2**31 - 0.5:
        return None
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def _structure(type_name: str, fields: tuple[tuple[str, Any], ...]) -> Any:  # noqa: ANN401
    numbers = [
        (name, value)
        for name, value in fields
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    if numbers and len(numbers) == len(fields):
        shaped = krl.pose_or_axes(type_name, numbers)
        if shaped is not None:
            return shaped
    return krl.Aggregate(fields, type_name)


def _unary(operator: str, value: Any) -> Any:  # noqa: ANN401
    if value is UNKNOWN:
        return UNKNOWN
    if operator == "NOT":
        return not value
    if isinstance(value, bool) or not isinstance(value, int | float):
        return UNKNOWN
    if operator == "-":
        return -value
    return ~value if isinstance(value, int) else UNKNOWN


def _arithmetic(operator: str, left: Any, right: Any) -> Any:  # noqa: ANN401
    try:
        if operator == "AND":
            return bool(left) and bool(right)
        if operator == "OR":
            return bool(left) or bool(right)
        if operator == "/":
            whole = isinstance(left, int) and isinstance(right, int)
            return int(left / right) if whole else left / right
        if isinstance(left, krl.Enum) and isinstance(right, krl.Enum):
            left, right = left.name.upper(), right.name.upper()
        result = _ARITHMETIC[operator](left, right)
    except (TypeError, ZeroDivisionError, OverflowError, KeyError):
        return UNKNOWN
    if isinstance(result, float) and not math.isfinite(result):
        return UNKNOWN
    return result


def _builtin(name: str, arguments: list[Any]) -> Any:  # noqa: ANN401
    if any(item is UNKNOWN for item in arguments):
        return UNKNOWN
    try:
        if name == "ATAN2":
            return math.atan2(arguments[0], arguments[1]) / DEG
        if name in ("INV_POS", "INV"):
            return pose_of(inverse(matrix_of(arguments[0])))
        return _DEGREES[name](arguments[0])
    except (TypeError, ValueError, IndexError, AttributeError):
        return UNKNOWN


def frame_product(left: Any, right: Any) -> Any:  # noqa: ANN401
    """Return ``left : right``, the pose ``right`` given in the frame ``left``."""
    if not (isinstance(left, krl.Pose) and isinstance(right, krl.Pose)):
        return UNKNOWN
    product = pose_of(matrix_of(left) @ matrix_of(right))
    return replace(
        product,
        status=right.status,
        turn=right.turn,
        external=right.external,
        type_name=right.type_name,
    )


def matrix_of(pose: krl.Pose) -> FloatArray:
    """Return the transform (4, 4) [m] of a pose; missing components count as 0."""
    xyz = [pose.x_mm or 0.0, pose.y_mm or 0.0, pose.z_mm or 0.0]
    abc = [pose.a_deg or 0.0, pose.b_deg or 0.0, pose.c_deg or 0.0]
    return transform_from_kuka(xyz, abc)


def pose_of(T: FloatArray) -> krl.Pose:
    """Return a transform (4, 4) [m] as a pose [mm, deg]."""
    xyz, abc = kuka_from_transform(T)
    return krl.Pose(*xyz.tolist(), *abc.tolist())


def point_with(values: Sequence[float | None], like: Point) -> Point:
    """Return a point of other six numbers [mm, deg], with the rest of a point like it."""
    return replace(like, **dict(zip(krl.FIELDS[type(like)].values(), values, strict=False)))  # type: ignore[arg-type]


def text_of(value: Any) -> str:  # noqa: ANN401
    """Return a short text of a value for messages."""
    if isinstance(value, krl.Enum):
        return f"#{value.name}"
    if isinstance(value, krl.Text):
        return value.value
    return str(value)


def plain_arguments(arguments: tuple[Any, ...]) -> tuple[object, ...]:
    """Return arguments of a hook as numbers and texts."""
    return tuple(a if isinstance(a, int | float) else text_of(a) for a in arguments)
