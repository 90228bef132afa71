"""Closed forms as users hold them: expressions that can be evaluated, and printed."""

from __future__ import annotations

from linkwork.export.symbolic.forms import FormulaSheet
from linkwork.export.symbolic.page import document, module


class ClosedForms(FormulaSheet):
    """Hold the equations of motion in closed form; `FormulaSheet` says what they are."""

    def latex(self) -> str:
        """Return a LaTeX document of the equations, which needs amsmath."""
        return document(self)

    def source(self) -> str:
        """Return the text of a Python module that makes the same expressions with SymPy alone."""
        return module(self)
