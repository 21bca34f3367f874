"""Converts equations written as text ('F = -1/2 rho cd v |v|') to MathML, which browsers draw without a font or script.

Reads sums, products (also without a sign between factors), fractions, powers, functions, absolute values; names of Greek
letters, and indices after '_' or as digits. Text that it cannot read stays text, so that no equation is lost.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from html import escape

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ", "kappa": "κ",
    "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "chi": "χ",
    "psi": "ψ", "omega": "ω", "Delta": "Δ", "Omega": "Ω", "Phi": "Φ", "Psi": "Ψ", "Sigma": "Σ", "Theta": "Θ",
}  # fmt: skip
FUNCTIONS = ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "ln", "sign", "min", "max", "abs")
WORDS = ("for", "if", "until", "where", "with", "and", "or", "else", "while", "alone")
TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)|(?P<name>\.\.\.|[A-Za-zα-ωΑ-Ω][A-Za-z0-9_α-ω]*(?:\.[A-Za-z_]\w*)*'*)"
    r"|(?P<sign>->|\+=|<=|>=|[-+*·/^(),|=<>²³−]))"
)
RELATIONS = {"->": "→", "=": "=", "+=": "+=", "<": "&lt;", ">": "&gt;", "<=": "≤", ">=": "≥"}
OPEN, CLOSE = "<mrow><mo>(</mo>", "<mo>)</mo></mrow>"
MEMORIES = ("play(", "lowpass(")  # their second argument is a quantity with a unit, no symbol
POWERS = {"²": "2", "³": "3"}


class _NoEquationError(ValueError):
    """The text is not of the grammar."""


def mathml(text: str) -> str:
    """Markup of one or several equations separated by commas or semicolons; the text itself is its label."""
    parts = [_part(part) for part in _pieces(text)]
    joined = "<mtext>,&#8195;</mtext>".join(parts)
    return f'<math display="block" aria-label="{escape(text)}"><mrow>{joined}</mrow></math>'


def added(place: str, functions: Sequence[str], signals: Collection[str] = ()) -> str:
    """'place += c1 f1 + c2 f2' of terms whose place and functions are given as text; signals: names that are not symbols."""
    terms = [
        symbol(f"c{i}") + ("" if text == "1" else f"<mspace width='0.25em'/>{_part(text, signals)}")
        for i, text in enumerate(functions, start=1)
    ]
    label = f"{place} += " + " + ".join(f"c{i} {text}" for i, text in enumerate(functions, start=1))
    inner = f"<mtext>{escape(place)}</mtext><mo>+=</mo>{'<mo>+</mo>'.join(terms)}"
    return f'<math display="block" aria-label="{escape(label)}"><mrow>{inner}</mrow></math>'


def _pieces(text: str) -> list[str]:
    """Split at commas and semicolons outside of brackets."""
    found, depth, start = [], 0, 0
    for i, letter in enumerate(text):
        # commas inside of brackets separate arguments of a function
        depth += (letter == "(") - (letter == ")")
        if letter in ",;" and depth == 0:
            found.append(text[start:i].strip())
            start = i + 1
    return [piece for piece in (*found, text[start:].strip()) if piece]


def _part(text: str, signals: Collection[str] = ()) -> str:
    try:
        if text.startswith(MEMORIES):
            raise _NoEquationError
        return _Reader(text, signals).equation()
    except _NoEquationError:
        return f"<mtext>{escape(text)}</mtext>"


class _Reader:
    """Recursive descent over the tokens of one equation."""

    def __init__(self, text: str, signals: Collection[str] = ()) -> None:
        self._tokens = list(_tokens(text))
        self._signals = signals
        self._at = 0
        self._bars = 0  # open absolute values: a bar then closes

    def equation(self) -> str:
        parts = [self._sum()]
        while self._next in RELATIONS:
            parts.append(f"<mo>{RELATIONS[self._take()]}</mo>{self._sum()}")
        if self._next:
            raise _NoEquationError
        return "".join(parts)

    @property
    def _next(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    @property
    def _kind(self) -> str:
        return self._tokens[self._at][0] if self._at < len(self._tokens) else ""

    def _take(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1][1]

    def _expect(self, sign: str) -> None:
        if self._next != sign:
            raise _NoEquationError
        self._take()

    def _sum(self) -> str:
        parts = []
        if self._next in ("-", "−", "+"):
            parts.append(_sign(self._take()))
        parts.append(self._product())
        while self._next in ("+", "-", "−"):
            parts.append(_sign(self._take()) + self._product())
        return "".join(parts)

    def _product(self) -> str:
        factors: list[tuple[str, str]] = [self._power()]
        while True:
            if self._next in ("*", "·"):
                self._take()
                factors.append(self._power())
            elif self._next == "/":
                self._take()
                below = self._power()
                # d x / d t belongs together; else all so far is above the line
                above = factors[-1:] if _differential(factors[-1][0]) and _differential(below[0]) else factors
                factors = factors[: len(factors) - len(above)]
                line = f"<mfrac><mrow>{_row(above)}</mrow><mrow>{_bare(below)}</mrow></mfrac>"
                factors.append(("", line))
            elif (
                self._kind in ("number", "name")
                or self._next == "("
                or (self._next == "|" and not self._bars)
            ):
                factors.append(self._power())
            else:
                return _row(factors)

    def _power(self) -> tuple[str, str]:
        name, base = self._base()
        while self._next in ("^", *POWERS):
            name, sign = "", self._take()
            over = f"<mn>{POWERS[sign]}</mn>" if sign in POWERS else self._exponent()
            base = f"<msup><mrow>{base}</mrow><mrow>{over}</mrow></msup>"
        return name, base

    def _exponent(self) -> str:
        minus = _sign(self._take()) if self._next in ("-", "−") else ""
        return minus + _bare(self._base())

    def _base(self) -> tuple[str, str]:
        kind, text = self._kind, self._take() if self._kind else ""
        if kind == "number":
            return text, f"<mn>{text}</mn>"
        if kind == "name":
            return text, self._called(text)
        if text == "(":
            inner = self._within_brackets()
            return "(", f"{OPEN}{inner}{CLOSE}"
        if text == "|":
            self._bars += 1
            inner = self._sum()
            self._bars -= 1
            self._expect("|")
            return "", f"<mrow><mo>|</mo>{inner}<mo>|</mo></mrow>"
        raise _NoEquationError

    def _within_brackets(self) -> str:
        outer, self._bars = self._bars, 0
        inner = self._sum()
        while self._next == ",":
            self._take()
            inner += f"<mo>,</mo>{self._sum()}"
        self._bars = outer
        self._expect(")")
        return inner

    def _called(self, name: str) -> str:
        """A name, or a function of what stands in brackets right behind it."""
        if name in self._signals:
            return f"<mtext>{escape(name)}</mtext>"
        at = self._tokens[self._at] if self._at < len(self._tokens) else ("", "", False)
        if at[1] != "(" or at[2]:
            return symbol(name)
        self._take()
        inner = self._within_brackets()
        if name == "sqrt":
            return f"<msqrt>{inner}</msqrt>"
        return f"{symbol(name)}<mo>&#8289;</mo><mrow><mo>(</mo>{inner}<mo>)</mo></mrow>"


def _tokens(text: str) -> Iterator[tuple[str, str, bool]]:
    """Kind, text, and whether a space stands before it."""
    at = 0
    while at < len(text.rstrip()):
        match = TOKEN.match(text, at)
        if match is None:
            raise _NoEquationError
        kind = str(match.lastgroup)
        yield kind, match[kind], text[at : match.start(kind)] != ""
        at = match.end()


def symbol(name: str) -> str:
    """A letter in italics, a word upright, indices below: 'F_brake', 'v0', 'delta_command', 'dtheta'."""
    if name in WORDS:
        return f"<mtext>&#8194;{name}&#8194;</mtext>"
    if name == "...":
        return "<mi>…</mi>"
    head, _, index = name.partition("_")
    if not index and (match := re.fullmatch(r"([A-Za-z]+?)(\d+)", head)):
        head, index = match[1], match[2]
    base = _letter(head)
    if not index:
        return base
    below = f"<mn>{index}</mn>" if index.isdigit() else f"<mtext>{escape(index.replace('_', ' '))}</mtext>"
    return f"<msub>{base}{below}</msub>"


def _letter(name: str) -> str:
    if name in GREEK:
        return f"<mi>{GREEK[name]}</mi>"
    if _differential(name) and name not in FUNCTIONS:
        return f"<mrow><mi>d</mi>{_letter(name[1:])}</mrow>" if len(name) > 1 else "<mi>d</mi>"
    return f"<mi>{escape(name)}</mi>"


def _differential(name: str) -> bool:
    """'dt', 'dv', 'dtheta', or the operator 'd' itself."""
    rest = name[1:]
    return name.startswith("d") and (len(name) <= 2 or rest in GREEK)


def _sign(text: str) -> str:
    return f"<mo>{'−' if text in '-−' else '+'}</mo>"


def _row(factors: Sequence[tuple[str, str]]) -> str:
    """Factors side by side; a thin space keeps words apart."""
    return "<mspace width='0.17em'/>".join(markup for _, markup in factors)


def _bare(factor: tuple[str, str]) -> str:
    """Without outer brackets, which a fraction's line or an exponent's place makes superfluous."""
    name, markup = factor
    return markup.removeprefix(OPEN).removesuffix(CLOSE) if name == "(" else markup
