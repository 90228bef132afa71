"""A robot's equations of motion in closed form, to be read: as SymPy expressions and as LaTeX."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.patience import announced
from linkwork.robot import Robot

if TYPE_CHECKING:
    from linkwork.export.symbolic.closed import ClosedForms

SymbolsOf = Literal["free", "all"]


def sympy(robot: Robot, *, symbols: SymbolsOf = "free") -> ClosedForms:
    """Derive a robot's equations of motion in closed form, as SymPy expressions.

        phi(q) = 0,   Phi q' = 0,   q' = L v,   M v' + C v + G = S' u + f

    They are derived from the description a second time, with exact numbers, and compared with the
    kernels at the robot's home. In a planar mechanism q holds the coordinates of all joints, as in
    the paper; in space those of the spanning tree. Independent are the rates that are the robot's.

    Args:
        robot: a robot of a few freedoms, whose tree turns and slides about and along axes.
        symbols: "free": the robot's free numbers (`Robot.free`) are symbols, all others are
            written out; "all": lengths, masses, inertias and gravity are symbols too, equal ones
            of bodies that are alike the same.

    Returns:
        A `ClosedForms`: `phi`, `Phi`, `L`, `M`, `Cv`, `G` as matrices in named sub-expressions
            (`definitions`), `evaluate(positions, rates)`, `written_out(expression)`, `latex()`,
            `source()`.

    Raises:
        LinkworkError: SymPy is not installed; joints that turn freely, or loops that couple more
            rates than can be solved at a time; more operations than are printed.

    Source: the paper, Eqs. (1), (2), (7), (10)-(12).
    """
    checks.needed(robot, Robot)
    if not checks.among(symbols, ("free", "all")):
        raise LinkworkError(f"symbols is {checks.shown(symbols)}; choose from 'free', 'all'")
    try:
        from linkwork.export.symbolic.derivation import derived
    except ModuleNotFoundError as error:
        if error.name != "sympy":
            raise
        raise LinkworkError(
            "closed forms need SymPy, which is not installed; pip install 'linkwork[sympy]'"
        ) from None
    with announced("deriving closed forms"):
        return derived(robot, symbols)


def latex(robot: Robot, *, symbols: SymbolsOf = "free") -> str:
    """Return a LaTeX document of a robot's equations of motion in closed form; symbols, and what is
    refused, are those of `sympy`."""
    return sympy(robot, symbols=symbols).latex()
