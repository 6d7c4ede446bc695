"""Formulas of custom effects: a small language that is checked and made a program, never run as Python.

It has numbers, + - * / **, brackets, the functions abs, sign, sin, cos, exp, min, max, and the names in
`mecanum_env.wheel_drive.program.INPUTS`. Everything else is refused.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from functools import lru_cache
from typing import Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.wheel_drive.program import CODES, INPUTS, Program, require_runs

LONGEST_TEXT: Final = 400
"""Most characters of a formula."""
DEEPEST: Final = 40
"""Most levels of nesting of a formula."""
FUNCTIONS: Final = ("abs", "sign", "sin", "cos", "exp", "min", "max")
"""The functions of the language; min and max take two numbers or more, the others one."""

_FOREIGN: Final = re.compile(r"[^0-9A-Za-z_+\-*/(),. ]")
_OPERATORS: Final[dict[type[ast.operator], str]] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}


@lru_cache(maxsize=256)
def compile_formula(text: str) -> Program:
    """Return the program of a formula `text`.

    Raises:
        InputError: something that is no formula, an unknown name or function, a formula that is too long or
            nested too deep.
    """
    shown = repr(text if len(text) <= 80 else f"{text[:77]}...")
    try:
        program = _instructions(_parsed(text), 1)
        require_runs(program)
    except InputError as error:
        raise InputError(f"{shown}: {error}") from None
    return program


def _parsed(text: str) -> ast.expr:
    if len(text) > LONGEST_TEXT:
        raise InputError(f"too long, it has {len(text)} characters of at most {LONGEST_TEXT}")
    if foreign := _FOREIGN.search(text):
        raise InputError(
            f"unknown character {foreign.group()!r}; a formula is made of numbers, names and + - * / **"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, Warning, ValueError, MemoryError, RecursionError):
        raise InputError('not a formula; write one such as "-0.08 * speed * sin(3 * angle)"') from None


def _instructions(node: ast.expr, level: int) -> Program:
    if level > DEEPEST:
        raise InputError(f"nested too deep, more than {DEEPEST} levels")
    if isinstance(node, ast.Constant):
        return (CODES["number"], _number(node.value))
    if isinstance(node, ast.Name):
        if node.id not in INPUTS:
            raise InputError(
                f"unknown name {node.id}{did_you_mean(node.id, INPUTS)}; known: {', '.join(INPUTS)}"
            )
        return (CODES[node.id],)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        if isinstance(node.operand, ast.Constant):
            return (CODES["number"], -_number(node.operand.value))
        return (*_instructions(node.operand, level + 1), CODES["negative"])
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd):
        return _instructions(node.operand, level + 1)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        both = (*_instructions(node.left, level + 1), *_instructions(node.right, level + 1))
        return (*both, CODES[_OPERATORS[type(node.op)]])
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return _call(node, node.func.id, level)
    raise InputError(f"{ast.unparse(node)} is not part of the language of formulas")


def _call(node: ast.Call, name: str, level: int) -> Program:
    if name not in FUNCTIONS:
        raise InputError(
            f"unknown function {name}{did_you_mean(name, FUNCTIONS)}; known: {', '.join(FUNCTIONS)}"
        )
    least = 2 if name in ("min", "max") else 1
    if node.keywords or len(node.args) < least or (least == 1 and len(node.args) > 1):
        raise InputError(f"{name} takes {'two numbers or more' if least == 2 else 'one number'}")
    program = _instructions(node.args[0], level + 1)
    for argument in node.args[1:]:
        program = (*program, *_instructions(argument, level + 1), CODES[name])
    return program if least == 2 else (*program, CODES[name])


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{value!r} is no number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError("a number is beyond double precision")
    return number
