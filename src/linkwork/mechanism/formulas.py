"""Formulas: numbers of a description that follow from named quantities, "rod/2" or "30 deg".

Sums, products, quotients, powers and a few functions of numbers, names and pi; `deg` behind a
number turns degrees into radians. The text is parsed by Python's own parser, and only what is
listed here is worked out: nothing is ever executed. A formula of free quantities is worked out on
their symbols.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from linkwork.mechanism.refusal import MechanismError, shown, suggestion

LONGEST = 500  # characters
DEG = math.pi / 180
CONSTANTS = {"pi": math.pi, "deg": DEG}
FUNCTIONS: dict[str, tuple[Callable[..., float], str]] = {
    "sin": (math.sin, "sin"),
    "cos": (math.cos, "cos"),
    "tan": (math.tan, "tan"),
    "asin": (math.asin, "arcsin"),
    "acos": (math.acos, "arccos"),
    "atan": (math.atan, "arctan"),
    "atan2": (math.atan2, "arctan2"),
    "sqrt": (math.sqrt, "sqrt"),
}
"""Each of numbers, and the method by which expressions have it."""
ARGUMENTS = {"atan2": 2}
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
DEGREES = re.compile(
    r"(?<![\w.])((?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*deg\b(?!\s*\()", re.ASCII
)
CHARACTERS = re.compile(r"[\w\s.+\-*/(),]*\Z", re.ASCII)


def parsed(text: str) -> ast.expr:
    """Return the syntax tree of a formula; refuse what is none."""
    found = _parsed(text)
    if isinstance(found, str):
        raise MechanismError(f"{shown(text)} is no formula: {found}")
    return found


def is_formula(text: str) -> bool:
    """Tell whether a text is a formula, whatever its names mean."""
    return not isinstance(_parsed(text), str)


@lru_cache(maxsize=4096)
def _parsed(text: str) -> ast.expr | str:
    """Return the syntax tree of a formula, or what is wrong with the text."""
    if len(text) > LONGEST:
        return f"it has {len(text)} characters; the longest has {LONGEST}"
    if not CHARACTERS.match(text):
        return "it holds other signs than numbers, names, + - * / ** ( ) and commas"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            tree = ast.parse(DEGREES.sub(r"(\1*deg)", text).strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return "write it as rod/2, 2*(a + b) or 30 deg"
    return fault_of(tree) or tree


def fault_of(tree: ast.expr) -> str:
    """Return what a syntax tree holds that no formula may; empty where it is one."""
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=bool()) | ast.Constant(value=str()):
                return "write numbers, names and functions only"
            case ast.Constant(value=int() | float()) | ast.Name() | ast.Load():
                pass
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                if name not in FUNCTIONS:
                    known = ", ".join(FUNCTIONS)
                    return f"there is no function {name!r}; there are {known}"
                if len(arguments) != (count := ARGUMENTS.get(name, 1)):
                    return f"{name} takes {count} argument{'s' * (count > 1)}"
            case ast.BinOp() | ast.UnaryOp():
                if type(node.op) not in OPERATORS:
                    return "write + - * / ** only"
            case ast.operator() | ast.unaryop():
                pass
            case _:
                return "write numbers, names and functions only"
    return ""


def names_in(text: str) -> tuple[str, ...]:
    """Return the quantities that a formula asks for, in their order."""
    called = {id(node.func) for node in ast.walk(parsed(text)) if isinstance(node, ast.Call)}
    named = (node for node in ast.walk(parsed(text)) if isinstance(node, ast.Name))
    own = (node.id for node in named if id(node) not in called and node.id not in CONSTANTS)
    return tuple(dict.fromkeys(own))


def value_of(text: str, names: Mapping[str, Any]) -> Any:
    """Return the value of a formula: a number, or an expression where a name's value is one.

    Raises:
        MechanismError: a text that is no formula, names that are not known, a division by zero, a
            root of what is below zero, values that are not finite.
    """
    tree = parsed(text)
    for name in names_in(text):
        if name not in names:
            known = ", ".join(names) or "none"
            raise MechanismError(
                f"{shown(text)} asks for {name!r}, which is no named quantity"
                f"{suggestion(name, names)}; under 'let' there are: {known}"
            )
    try:
        value = evaluated(tree, {**CONSTANTS, **names})
    except ZeroDivisionError:
        raise MechanismError(f"{shown(text)} divides by zero") from None
    except (ValueError, OverflowError, TypeError):
        raise MechanismError(f"{shown(text)} has no finite value with these quantities") from None
    if isinstance(value, float | int | complex) and not (
        isinstance(value, float | int) and math.isfinite(value)
    ):
        raise MechanismError(f"{shown(text)} has no finite value with these quantities")
    return value


def evaluated(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """Return the value of a part of a formula."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=op, operand=operand):
            return OPERATORS[type(op)](evaluated(operand, names))
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](evaluated(left, names), evaluated(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            given = [evaluated(argument, names) for argument in arguments]
            function, method = FUNCTIONS[name]
            if all(isinstance(each, float) for each in given):
                return function(*given)
            first, *others = given
            if isinstance(first, float):
                first = first + 0 * others[0]
            return getattr(first, method)(*others)
    raise AssertionError(ast.dump(node))


def is_angle(node: ast.expr) -> bool:
    """Tell whether a part of a formula is an angle by its suffix: degrees, or a number of them."""
    match node:
        case ast.Name(id="deg"):
            return True
        case ast.UnaryOp(operand=operand):
            return is_angle(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return is_angle(left) or is_angle(right)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return (is_angle(left) and constant(right)) or (is_angle(right) and constant(left))
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return is_angle(left) and constant(right)
    return False


def constant(node: ast.expr) -> bool:
    """Tell whether a part of a formula is a plain number."""
    names = (part.id for part in ast.walk(node) if isinstance(part, ast.Name))
    return all(name in FUNCTIONS or name == "pi" for name in names)


def is_linear(text: str) -> bool:
    """Tell whether a formula is a sum of multiples of its names and a number."""
    tree = parsed(text)
    named = (node for node in ast.walk(tree) if isinstance(node, ast.Name))
    own = [node for node in named if node.id not in (*CONSTANTS, *FUNCTIONS)]
    return len(own) == len([*multiples(tree)])


def multiples(node: ast.expr) -> Iterator[str]:
    """Yield the names that a formula is a sum of multiples of: they have its unit."""
    match node:
        case ast.Name(id=name) if name not in CONSTANTS:
            yield name
        case ast.UnaryOp(operand=operand):
            yield from multiples(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            yield from multiples(left)
            yield from multiples(right)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            yield from multiples(left) if constant(right) else ()
            yield from multiples(right) if constant(left) else ()
        case ast.BinOp(left=left, op=ast.Div(), right=right) if constant(right):
            yield from multiples(left)
