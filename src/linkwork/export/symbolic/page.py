"""Closed forms as a LaTeX document, and as a Python module of SymPy expressions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import sympy

from linkwork.export.symbolic.forms import FormulaSheet

WIDE = 85  # letters of a line, as they are counted without commands
MARKS = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
SEVERAL = 4  # terms that a fraction's numerator has before it is written beside the fraction
OPENING = r"""\documentclass{article}
\usepackage{amsmath}
\usepackage[margin=2cm]{geometry}
\allowdisplaybreaks
\begin{document}
"""
CLOSING = "\\end{document}\n"
SAID = {
    "Angles": "Coordinates with the constant angles that frames add to them.",
    "Elements of the dependent rates' equations": (
        r"The dependent rates follow from $\Phi \dot q = 0$ by elimination; these are its "
        r"coefficients $A$, $B$ and determinants $\Delta$."
    ),
    "Orthogonal complement": (
        r"$\dot q = L v$. Rows of independent rates are those of the unit matrix; elements that "
        "are not listed are zero."
    ),
    "Rates": r"The dependent rates, $\dot q = L v$.",
    "Bias of the loop equations": r"What is left of $\ddot\phi$ at $\ddot q = 0$.",
    "Bias of the accelerations": r"$\ddot q = L \dot v + b$, from $\Phi b + \gamma = 0$.",
    "Inertia of the tree": (
        r"$H = K^T M_{tot} K$ of the coordinates $q$, symmetric; elements that are not listed are "
        "zero."
    ),
    "Inertia forces of the tree": r"Coriolis and centrifugal forces at $\ddot q = 0$.",
    "Weight": "Forces that hold the weight.",
    "Inertia forces at v' = 0": r"$c = h + H b$.",
}
"""What is said of each section."""


def document(forms: FormulaSheet) -> str:
    """Return a LaTeX document of closed forms, which needs amsmath."""
    parts = [OPENING, f"\\section*{{{escaped(forms.name)}: equations of motion}}\n"]
    free = ", ".join(f"${forms.letters[forms.rates[name]]}$" for name in forms.independent)
    parts.append(
        "$M \\dot v + C v + G = S^T u + f$ in the independent rates $v$ = "
        f"({free}), by the natural orthogonal complement. The forces $u$ of the actuators act on "
        "the rates $S v$; $f$, the forces of springs, dampers and friction, is not printed.\n\n"
    )
    parts.append("\\begin{itemize}\\setlength{\\itemsep}{0pt}\n")
    parts += [f"\\item {line}\n" for line in symbol_lines(forms)]
    parts.append("\\end{itemize}\n")
    for title, said, equations in sections(forms):
        parts.append(f"\\subsection*{{{escaped(title)}}}\n{said}\n" if said else "")
        parts.append("\\begin{align*}\n" + " \\\\\n".join(equations) + "\n\\end{align*}\n")
    return "".join([*parts, CLOSING])


def symbol_lines(forms: FormulaSheet) -> Iterator[str]:
    """Yield what each symbol means, and its value."""
    for symbol, meaning in forms.meanings.items():
        value = forms.parameters.get(symbol)
        told = "" if value is None else f" = {value:.12g}"
        told = re.sub(r"e([+-])0*(\d+)", r" \\cdot 10^{\1\2}", told).replace("{+", "{")
        yield f"${forms.letters[symbol]}{told}$: {escaped(meaning)}"


def sections(forms: FormulaSheet) -> Iterator[tuple[str, str, list[str]]]:
    """Yield title, what is said, and the equations, of each section in its order."""
    named = {part.title: part.equations for part in forms.sections}
    if angles := named.pop("Angles", None):
        yield "Angles", SAID["Angles"], lines_of(forms, angles)
    if len(forms.rows):
        phi = [
            equation(forms, f"\\phi_{{{i}}}", x) for i, x in enumerate(forms.phi.flat(), start=1)
        ]
        yield "Loop equations", r"$\phi(q) = 0$", [f"{line} = 0" for line in phi]
        said = r"$\Phi = \partial\phi / \partial q$; elements that are not listed are zero."
        yield "Constraint Jacobian", said, elements(forms, "\\Phi", forms.Phi)
    for title, equations in named.items():
        yield title, SAID[title], lines_of(forms, equations)
    said = r"$M = L^T H L$, symmetric"
    yield "Generalised inertia", said, elements(forms, "M", forms.M, symmetric=True)
    Cv = [equation(forms, f"(C v)_{{{i}}}", x) for i, x in enumerate(forms.Cv.flat(), start=1)]
    yield "Coriolis and centrifugal forces", r"$C v = L^T c$", Cv
    G = [equation(forms, f"G_{{{i}}}", x) for i, x in enumerate(forms.G.flat(), start=1)]
    yield "Forces that hold the weight", r"$G = L^T w$", G


def lines_of(forms: FormulaSheet, equations: Mapping[sympy.Symbol, sympy.Expr]) -> list[str]:
    return [equation(forms, forms.letters[name], value) for name, value in equations.items()]


def elements(
    forms: FormulaSheet, letter: str, matrix: sympy.Matrix, symmetric: bool = False
) -> list[str]:
    """Return the elements of a matrix that are not zero; the upper triangle of a symmetric one."""
    return [
        equation(forms, f"{letter}_{{{i + 1},{j + 1}}}", matrix[i, j])
        for i in range(matrix.rows)
        for j in range(matrix.cols)
        if matrix[i, j] != 0 and not (symmetric and j < i)
    ]


def equation(forms: FormulaSheet, left: str, value: Any) -> str:
    """Return an equation, in lines that are not too wide."""
    above, below = value.as_numer_denom() if value.is_Mul else (value, sympy.Integer(1))
    if below.free_symbols and isinstance(above, sympy.Add) and len(above.args) >= SEVERAL:
        inner = sums(forms, above)
        brackets = ("(", ")") if "\\\\" in inner else ("\\left(", "\\right)")
        return f"{left} &= \\frac{{1}}{{{printed(forms, below)}}}{brackets[0]}{inner}{brackets[1]}"
    return f"{left} &= {sums(forms, value)}"


def sums(forms: FormulaSheet, value: sympy.Expr) -> str:
    """Return a sum with breaks between its terms."""
    if not isinstance(value, sympy.Add):
        return printed(forms, value)
    lines, line = [], ""
    for term in value.as_ordered_terms():
        text = printed(forms, term)
        first = not line and not lines
        joined = text if first else f" - {text[1:]}" if text[0] == "-" else f" + {text}"
        if line and width(line + joined) > WIDE:
            lines, line = [*lines, line], ""
        line += joined
    return " \\\\\n&\\quad".join([*lines, line])


def width(text: str) -> int:
    """Return about how many letters a formula is wide."""
    plain = re.sub(r"\\(left|right|quad)", "", text)
    return len(re.sub(r"\\[a-z]+|[{}_^ ]", "", re.sub(r"\\(sin|cos)", "abc", plain)))


def printed(forms: FormulaSheet, value: Any) -> str:
    """Return the LaTeX of an expression in the symbols' letters."""
    return sympy.latex(value, symbol_names=dict(forms.letters), fold_func_brackets=True)


def escaped(text: str) -> str:
    """Return plain text as LaTeX, powers of units raised."""

    def mark(found: re.Match[str]) -> str:
        return f"$^{found[1]}$" if found[1] else MARKS.get(found[0], f"\\{found[0]}")

    return re.sub(r"\^(\d)|[\\~^_%&#${}]", mark, text)


# As a Python module


def module(forms: FormulaSheet) -> str:
    """Return the text of a Python module that makes the same expressions with SymPy."""
    # What it is, and its symbols.
    name = forms.name.replace("\\", r"\\").replace('"', r"\"")
    head = f'"""{name}: equations of motion in closed form, by the natural orthogonal '
    lines = [
        head + "complement.\n\n"
        "M v' + C v + G = S' u + f,   q' = L v,   phi(q) = 0,   Phi = d phi / d q\n\n"
        "`definitions` names sub-expressions in the order of evaluation; `written_out` puts them\n"
        'into an expression.\n"""\n',
        "from sympy import *\n",
    ]
    symbols = sorted(
        {*forms.letters} & used(forms), key=lambda symbol: [*forms.letters].index(symbol)
    )
    for symbol in symbols:
        meaning = forms.meanings.get(symbol)
        told = f"  # {meaning}" if meaning else ""
        lines.append(f'{symbol.name} = Symbol("{symbol.name}", real=True){told}')
    # Sub-expressions, parameters and what is made of them.
    lines.append("\ndefinitions = {")
    lines += [f"    {name}: {code(value)}," for name, value in forms.definitions.items()]
    lines.append("}")
    values = ", ".join(f"{symbol}: {value!r}" for symbol, value in forms.parameters.items())
    lines.append(f"parameters = {{{values}}}")
    q = ", ".join(map(str, forms.coordinates.values()))
    v = ", ".join(str(forms.rates[name]) for name in forms.independent)
    lines += [f"q = Matrix([{q}])", f"v = Matrix([{v}])"]
    for name in ("phi", "Phi", "L", "M", "Cv", "G"):
        matrix = getattr(forms, name)
        rows = ", ".join(code(x) for x in matrix.flat())
        lines.append(f"{name} = Matrix({matrix.rows}, {matrix.cols}, [{rows}])")
    # How they are put together.
    lines.append(
        "\n\ndef written_out(expression):\n"
        '    """Return an expression with all named sub-expressions put into it."""\n'
        "    for name, value in reversed(definitions.items()):\n"
        "        expression = expression.subs(name, value)\n"
        "    return expression\n"
    )
    return "\n".join(lines)


def used(forms: FormulaSheet) -> set[sympy.Symbol]:
    """Return the symbols that stand in the forms."""
    found = {*forms.definitions, *forms.parameters, *forms.coordinates.values()}
    found |= {forms.rates[name] for name in forms.independent}
    for name in ("phi", "Phi", "L", "M", "Cv", "G"):
        found |= getattr(forms, name).free_symbols
    return found.union(*(value.free_symbols for value in forms.definitions.values()))


def code(value: sympy.Expr) -> str:
    """Return an expression as Python reads it, with all digits of its decimals."""
    return sympy.sstr(value, full_prec=True)
