"""Parameters in scope, the filling in of ``$name`` and ``${expression}``, and the language of expressions.

That is the text between ``${`` and ``}`` of OpenSCENARIO 1.1 and later: numbers and booleans, with the operators of the
standard's section 9.2 (1.3.1) and, as the reference player does, the constant ``pi`` and the joining of words with
``+``, which field files use to build names. Nothing is ever handed to Python's own `eval`.

Precedence, loosest first: ``or``, ``and``, ``not``, comparison, ``+ -``, ``* / %``, unary minus, function call.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from operator import eq, ge, gt, le, lt, ne

from xosc_lateral.base.limits import EXPRESSION_SIZE, VALUE_SIZE
from xosc_lateral.world.scenario.enums import Rule

MAX_CHAIN = 30
"""Parameters referring to parameters. Bounds the recursion; field files stay under 5."""

_NAME = re.compile(r"\$([A-Za-z_][\w.]*)\Z")


class Scope:
    """Declared parameters, their values filled in when asked for, in any order of declaration.

    Values as written may refer to other parameters of this scope and of its parent, where names are looked up that are
    not declared here.
    """

    __slots__ = ("_done", "_open", "_raw", "parent")

    def __init__(self, raw: Mapping[str, str], parent: Scope | None = None) -> None:
        self._raw, self.parent = dict(raw), parent
        self._done: dict[str, str] = {}
        self._open: list[str] = []

    def value(self, name: str) -> str:
        """Value of a parameter; `ExpressionError` when it is unknown, or depends on itself."""
        if name not in self._raw:
            if self.parent is None:
                raise ExpressionError(f"parameter '{name}' is not declared")
            return self.parent.value(name)
        if name not in self._done:
            if name in self._open:
                cycle = " -> ".join([*self._open[self._open.index(name) :], name])
                raise ExpressionError(f"parameter '{name}' depends on itself ({cycle})")
            if len(self._open) >= MAX_CHAIN:
                raise ExpressionError(f"parameter '{name}': more than {MAX_CHAIN} parameters refer to one another")
            self._open.append(name)
            try:
                self._done[name] = self.fill(self._raw[name])
            finally:
                self._open.pop()
        return self._done[name]

    def fill(self, text: str) -> str:
        """Attribute text with its parameter or expression filled in; other text comes back as it is.

        A reference is the whole value (standard, section 9.1); ``\\$`` at its start stands for the character.
        """
        if not text.startswith("$"):
            return text[1:] if text.startswith("\\$") else text
        if text.startswith("${"):
            end = text.find("}")
            if end < 0:
                raise ExpressionError(f"'{text}': '}}' is missing")
            return evaluate(text[2:end], self.value)
        match = _NAME.match(text)
        return self.value(match[1]) if match else text

    def values(self) -> dict[str, str]:
        """All values of this scope, parents left out."""
        return {name: self.value(name) for name in self._raw}

    def local_values(self) -> dict[str, str]:
        """All values of this scope and its parents, the global one left out; inner ones win."""
        return {} if self.parent is None else {**self.parent.local_values(), **self.values()}


def satisfies(value: str, rule: Rule, limit: str) -> bool:
    """Whether ``value rule limit`` holds: as numbers if both are, else as text (then only equality counts)."""
    left, right = from_text(value), from_text(limit)
    if isinstance(left, str) or isinstance(right, str):
        return rule in (Rule.EQUAL_TO, Rule.NOT_EQUAL_TO) and rule.holds(value, limit)
    return rule.holds(left, right)


# ---- The expression language of OpenSCENARIO 1.1 and later: the t ----
Value = float | bool | str

MAX_DEPTH = 30
"""Nested parentheses and signs. Bounds the recursion."""

FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "round": (1, lambda a: _rounded(a)),
    "floor": (1, lambda a: float(math.floor(a))),
    "ceil": (1, lambda a: float(math.ceil(a))),
    "sqrt": (1, math.sqrt),
    "sin": (1, math.sin),
    "cos": (1, math.cos),
    "tan": (1, math.tan),
    "asin": (1, math.asin),
    "acos": (1, math.acos),
    "atan": (1, math.atan),
    "sign": (1, lambda a: float((a > 0) - (a < 0))),
    "abs": (1, abs),
    "pow": (2, math.pow),
    "max": (2, max),
    "min": (2, min),
}
CONSTANTS: dict[str, Value] = {"true": True, "false": False, "pi": math.pi}
COMPARISONS: dict[str, Callable[[float, float], bool]] = {"<": lt, ">": gt, "<=": le, ">=": ge, "==": eq, "!=": ne}
WORD_OPERATORS = {"and", "or", "not"}
SYNONYMS = {"&&": "and", "||": "or", "!": "not"}

_TOKEN = re.compile(
    r"""\s*(?:
        (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
      | \$(?P<parameter>[A-Za-z_][\w.]*)
      | (?P<word>[A-Za-z_][\w.]*)
      | (?P<operator><=|>=|==|!=|&&|\|\||[-+*/%(),<>!])
    )""",
    re.VERBOSE,
)


class ExpressionError(ValueError):
    """The expression can't be evaluated. The reader adds file, line and element."""


def evaluate(expression: str, resolve: Callable[[str], str]) -> str:
    """Value of an expression, what stands between ``${`` and ``}``, as attribute text.

    Numbers have 6 decimals, as the reference player writes them. `resolve`: name of a parameter to its value as text;
    raises what it wants for unknown names.

    Raises `ExpressionError`: Syntax, domain (``sqrt(-1)``, division by zero) or overflow.
    """
    if len(expression) > EXPRESSION_SIZE.value:
        raise ExpressionError(EXPRESSION_SIZE.refusal(len(expression)))
    try:
        tokens = _tokens(expression)
        if any(kind == "word" and word not in FUNCTIONS and word not in CONSTANTS for kind, word in tokens):
            return _joined(expression, resolve)
        return as_text(_Parser(tokens, resolve).parse())
    except RecursionError as error:
        raise ExpressionError(f"{_quoted(expression)}: nested too deeply") from error
    except (ZeroDivisionError, OverflowError, ValueError) as error:
        if isinstance(error, ValueError) and type(error) not in (ValueError, ExpressionError):
            raise  # an error of `resolve`
        raise ExpressionError(f"{_quoted(expression)}: {error}") from error


def _quoted(expression: str) -> str:
    return f"'${{{expression}}}'" if len(expression) <= 80 else f"'${{{expression[:80]}...'"


def as_text(value: Value) -> str:
    """A value as it would stand in an attribute."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if not math.isfinite(value):
        raise ExpressionError(f"gives {value}")
    return f"{value:.6f}"


def from_text(text: str) -> Value:
    """A parameter's text as a value: number, boolean, else the text."""
    if text in ("true", "false"):
        return text == "true"
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text


def _tokens(expression: str) -> list[tuple[str, str]]:
    tokens, at = [], 0
    text = expression.rstrip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise ExpressionError(f"unexpected '{text[at:].strip()[:10]}'")
        kind = str(match.lastgroup)
        word = match[kind]
        if kind == "operator" and word in SYNONYMS:
            word = SYNONYMS[word]
        if kind == "word" and word in WORD_OPERATORS:
            kind = "operator"
        tokens.append((kind, word))
        at = match.end()
    if not tokens:
        raise ExpressionError("empty expression")
    return tokens


def _joined(expression: str, resolve: Callable[[str], str]) -> str:
    """``$name + brake event`` -> ``Egobrake event``: words joined without the spaces around the plus."""
    parts = (part.strip() for part in expression.split("+"))
    joined = []
    for part in parts:
        if re.fullmatch(r"\$[A-Za-z_][\w.]*", part):
            joined.append(resolve(part[1:]))
        elif re.fullmatch(r"[\w .]+", part):
            joined.append(part)
        else:
            raise ExpressionError(f"unknown name or operator in '{part}'")
        _check_length(sum(map(len, joined)))
    return "".join(joined)


def _check_length(length: int) -> None:
    """Parameters that refer to each other twice double with every step."""
    if length > VALUE_SIZE.value:
        raise ExpressionError(VALUE_SIZE.refusal(length))


class _Parser:
    """Recursive descent over the tokens; one method per level of precedence."""

    def __init__(self, tokens: list[tuple[str, str]], resolve: Callable[[str], str]) -> None:
        self._tokens, self._resolve, self._at, self._depth = tokens, resolve, 0, 0

    def parse(self) -> Value:
        value = self._or()
        if self._at < len(self._tokens):
            raise ExpressionError(f"unexpected '{self._tokens[self._at][1]}'")
        return value

    def _accept(self, *operators: str) -> str | None:
        if self._at < len(self._tokens):
            kind, word = self._tokens[self._at]
            if kind == "operator" and word in operators:
                self._at += 1
                return word
        return None

    def _expect(self, operator: str) -> None:
        if self._accept(operator) is None:
            raise ExpressionError(f"'{operator}' is missing")

    def _or(self) -> Value:
        value = self._and()
        while self._accept("or"):
            right = _boolean(self._and())
            value = _boolean(value) or right
        return value

    def _and(self) -> Value:
        value = self._not()
        while self._accept("and"):
            right = _boolean(self._not())
            value = _boolean(value) and right
        return value

    def _not(self) -> Value:
        return not _boolean(self._nested(self._not)) if self._accept("not") else self._comparison()

    def _comparison(self) -> Value:
        value = self._sum()
        operator = self._accept(*COMPARISONS)
        return value if operator is None else COMPARISONS[operator](_number(value), _number(self._sum()))

    def _sum(self) -> Value:
        value = self._product()
        while operator := self._accept("+", "-"):
            right = self._product()
            if operator == "+" and isinstance(value, str) and isinstance(right, str):
                _check_length(len(value) + len(right))
                value += right
            else:
                value = _number(value) + (_number(right) if operator == "+" else -_number(right))
        return value

    def _product(self) -> Value:
        value = self._unary()
        while operator := self._accept("*", "/", "%"):
            left, right = _number(value), _number(self._unary())
            value = left * right if operator == "*" else left / right if operator == "/" else math.fmod(left, right)
        return value

    def _unary(self) -> Value:
        sign = self._accept("-", "+")
        if sign is None:
            return self._primary()
        value = _number(self._nested(self._unary))
        return -value if sign == "-" else value

    def _primary(self) -> Value:
        if self._accept("("):
            value = self._nested(self._or)
            self._expect(")")
            return value
        if self._at >= len(self._tokens):
            raise ExpressionError("ends too early")
        kind, word = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            return float(word)
        if kind == "parameter":
            return from_text(self._resolve(word))
        if kind == "word" and word in CONSTANTS:
            return CONSTANTS[word]
        if kind == "word":
            return self._call(word)
        raise ExpressionError(f"unexpected '{word}'")

    def _call(self, name: str) -> float:
        count, function = FUNCTIONS[name]
        self._expect("(")
        arguments = [_number(self._nested(self._or))]
        while self._accept(","):
            arguments.append(_number(self._nested(self._or)))
        self._expect(")")
        if len(arguments) != count:
            raise ExpressionError(f"{name} takes {count} argument{'s' * (count > 1)}, not {len(arguments)}")
        return function(*arguments)

    def _nested(self, rule: Callable[[], Value]) -> Value:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionError(f"nested more than {MAX_DEPTH} deep")
        value = rule()
        self._depth -= 1
        return value


def _rounded(value: float) -> float:
    """The nearest whole number, halves away from zero: `round` of C, as the standard's own evaluator has it."""
    whole = math.trunc(value)
    return float(whole if abs(value - whole) < 0.5 else whole + math.copysign(1.0, value))


def _number(value: Value) -> float:
    if isinstance(value, str):
        raise ExpressionError(f"'{value}' is not a number")
    return float(value)


def _boolean(value: Value) -> bool:
    if isinstance(value, str):
        raise ExpressionError(f"'{value}' is neither true nor false")
    return bool(value)
