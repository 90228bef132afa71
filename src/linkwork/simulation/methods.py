"""Methods: the one list of what integrates runs, by the names that users give.

What a method can do is said by its kind: whether it keeps to a step that it is given (`FixedStep`),
whether it takes stiff systems, by the Jacobian (`Rosenbrock`), and whether members of ensembles do
it side by side in lanes (`Tableau`). Refusals, the table of the docs and what studies accept follow
from this list.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from linkwork.checks import known, positive
from linkwork.errors import LinkworkError
from linkwork.simulation.eighth_order import dop853
from linkwork.simulation.fixed_steps import RK4, FixedStep, SymplecticEuler
from linkwork.simulation.rosenbrock import RODAS, Rosenbrock
from linkwork.simulation.sharp_smart import SHARP_SMART
from linkwork.simulation.tableaus import DORMAND_PRINCE, Tableau

Method = Tableau | Rosenbrock | FixedStep
MethodName = Literal["sharp_smart", "dormand_prince", "dop853", "rodas", "rk4", "symplectic_euler"]


@dataclass(frozen=True)
class Entry:
    """Say how a method is made, before it is.

    kind: its class; make: gives it, of a fixed step from its length [s]; use: what it is for
    """

    kind: type[Tableau | Rosenbrock | FixedStep]
    make: Callable[..., Method]
    use: str

    @property
    def fixed(self) -> bool:
        """Whether it needs a step."""
        return issubclass(self.kind, FixedStep)


COMPARED = "a fixed step, for real time and for comparisons"
METHODS: Mapping[MethodName, Entry] = {
    "sharp_smart": Entry(
        Tableau,
        lambda: SHARP_SMART,
        "order 7, steps by the error: chosen for smooth inputs and rtol of 1e-6 or less",
    ),
    "dormand_prince": Entry(
        Tableau,
        lambda: DORMAND_PRINCE,
        "order 5, steps by the error: chosen otherwise, with sampled forces or a sampled "
        "controller",
    ),
    "dop853": Entry(Tableau, dop853, "order 8: tolerances of 1e-10 and below"),
    "rodas": Entry(
        Rosenbrock, lambda: RODAS, "stiff springs, drives, friction; with the exact Jacobian"
    ),
    "rk4": Entry(RK4, RK4, f"order 4, {COMPARED}"),
    "symplectic_euler": Entry(SymplecticEuler, SymplecticEuler, f"order 1, {COMPARED}"),
}
FIXED = tuple(name for name, entry in METHODS.items() if entry.fixed)


def integrator(name: str | None, step: float | None) -> Method | None:
    """Return a method by its name, with the step [s] that it keeps to if it has a fixed one; None
    where neither is given; refuse names and steps that do not fit."""
    if name is None and step is None:
        return None
    if step is not None:
        positive(step, "step")
    if name is None:
        needed = " or ".join(map(repr, FIXED))
        raise LinkworkError(f"a step of {step:g} s needs a method that keeps to it: {needed}")
    known([name], list(METHODS), "method")
    entry = METHODS[name]  # pyright: ignore
    if entry.fixed and step is None:
        raise LinkworkError(f"{name} needs a step [s]")
    if not entry.fixed and step is not None:
        raise LinkworkError(f"{name} chooses its own steps; leave step out, or give max_step")
    return entry.make() if step is None else entry.make(float(step))
