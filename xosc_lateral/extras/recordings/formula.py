"""Formulas that a bus log carries: arithmetic with numpy over a channel's raw values. No other name means anything.

The language is that of numexpr, which loggers' tools share: ``+ - * / % **``, comparisons, ``& | ~`` of them, ``where``
and the functions below; `X` and `X1` are the raw value. All numbers are doubles. Nothing is handed to Python's `eval`.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.limits import EXPRESSION_SIZE

OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Mod: np.fmod,
    ast.Pow: np.power, ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal, ast.BitAnd: np.logical_and, ast.BitOr: np.logical_or,
    ast.UAdd: np.positive, ast.USub: np.negative, ast.Invert: np.logical_not,
}  # fmt: skip
_SAME = ("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh", "arccosh",
         "arctanh", "exp", "expm1", "log", "log10", "log1p", "sqrt", "abs", "floor", "ceil", "where")  # fmt: skip
FUNCTIONS: Mapping[str, Callable[..., Any]] = {name: getattr(np, name) for name in _SAME} | {
    "ln": np.log, "pow": np.power, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
}  # fmt: skip
CONSTANTS = {"INF": np.inf, "NaN": np.nan}


class FormulaError(Exception):
    """A formula that is none of this language."""


def evaluate(formula: str, raw: Any) -> FloatArray:
    """Physical values, shape (n,), of raw ones, shape (n,). [unit of the channel]"""
    if len(formula) > EXPRESSION_SIZE.value:
        raise FormulaError(EXPRESSION_SIZE.refusal(len(formula)))
    values = np.asarray(raw, dtype=np.float64)
    try:
        with np.errstate(all="ignore"):
            made = _value(ast.parse(formula.strip(), mode="eval").body, {"X": values, "X1": values, **CONSTANTS})
        return np.array(np.broadcast_to(np.asarray(made, dtype=np.float64), values.shape))
    except (SyntaxError, ValueError, TypeError, OverflowError, RecursionError, MemoryError) as error:
        raise FormulaError(f"{formula[:60]!r} is no arithmetic of X ({type(error).__name__})") from error


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=bool() | int() | float() as number):
            return np.float64(number)
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=sign, operand=one) if type(sign) in OPERATORS:
            return OPERATORS[type(sign)](_value(one, names))
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in OPERATORS:
            return OPERATORS[type(sign)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=[sign], comparators=[right]) if type(sign) in OPERATORS:
            return OPERATORS[type(sign)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](*(_value(one, names) for one in args))
    raise FormulaError(f"{ast.unparse(node)[:60]!r} is not known to the formulas of this package")
