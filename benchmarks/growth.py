"""How deriving, compiling and forward dynamics grow with open trees, beside Pinocchio's ABA, and
with ladders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from linkwork.equations import derive, functions
from linkwork.kernels import Kernel, compile_function
from linkwork.lab.engines.pinocchio import PinocchioEngine, pin
from linkwork.mechanism import Mechanism
from linkwork.robots import n_four_bar

from benchmarks import native
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, empty_cache, interleaved, us
from tests.oracle.hinges import hinges

HINGES, LIMBS, LOOPS = (6, 12, 24, 60, 120), (1, 4), 1000
STATES, PIN_CALLS = 32, 10
COLUMNS = ("tree", "operations", "derive, trace, compile", "Linkwork", "Pinocchio", "ratio")
METHOD = """
    Bodies on hinges in general positions: chains, and trees of four limbs that begin on the first
    body. Processor time of deriving, tracing and compiling forward dynamics for one state, with an
    empty cache. Forward dynamics: Linkwork's kernel in a native loop, each state waiting for the
    one before; Pinocchio's `aba` called from Python, less the time of a call for one body. Ratio:
    Pinocchio's time over Linkwork's. The ladder: `lw.robots.n_four_bar(1000)`, to machine code for
    one state.
    """


@dataclass(frozen=True)
class Tree:
    """Hold what a tree of hinges took.

    operations: of the compiled program; compiling: processor time of all steps [s]; ours, theirs:
    time of one forward dynamics [us]
    """

    name: str
    operations: int
    compiling: float
    ours: float
    theirs: float

    @property
    def row(self) -> tuple[str, ...]:
        """Return the row of the listing."""
        return (
            self.name,
            str(self.operations),
            quantity(self.compiling, "s"),
            quantity(self.ours, "µs"),
            quantity(self.theirs, "µs"),
            quantity(self.theirs / self.ours, ""),
        )


def run(
    counts: Sequence[int] = HINGES,
    limbs: Sequence[int] = LIMBS,
    loops: int = LOOPS,
    rounds: int = 15,
) -> Section:
    """Measure trees of each size, and the largest ladder."""
    call = aba(hinges(1), rounds)
    trees = [measured(count, each, call, rounds) for each in limbs for count in counts]
    _, _, ladder = compiled(n_four_bar(loops))
    sixty = [tree for tree in trees if tree.name.endswith(" 60")]
    figures = [
        *(Figure(f"{tree.name}: derive, trace, compile", tree.compiling, "s", 5.0)
          for tree in sixty),
        Figure("Pinocchio's time over Linkwork's, least", min(t.theirs / t.ours for t in trees), "",
               1.0, "at least"),
        Figure(f"ladder of {loops}: derive, trace, compile", ladder, "s", 20.0),
    ]  # fmt: skip
    raw = {tree.name: vars(tree) for tree in trees} | {"ladder": ladder}
    listing = Listing(COLUMNS, [tree.row for tree in trees])
    return Section("Growth", METHOD, figures, raw, listing=listing)


def compiled(mechanism: Mechanism) -> tuple[Kernel, np.ndarray, float]:
    """Return forward dynamics as a kernel for one state, the reference, and the processor time."""
    with empty_cache():
        start = process_time()
        equations = derive(mechanism)
        kernel = compile_function(functions.motion(equations))
        assert kernel.address
        return kernel, equations.reference, process_time() - start


def measured(count: int, limbs: int, call: float, rounds: int) -> Tree:
    """Return what a tree took; call: time of a call of Pinocchio's for next to nothing [us]."""
    mechanism = hinges(count, limbs)
    kernel, q, seconds = compiled(mechanism)
    times = interleaved(native.evaluations(kernel, q, STATES), rounds)
    name = f"chain of {count}" if limbs == 1 else f"{limbs} limbs of together {count}"
    theirs = aba(mechanism, rounds) - call
    return Tree(name, kernel.operations, seconds, us(times["one by one"]), theirs)


def aba(mechanism: Mechanism, rounds: int) -> float:
    """Return the time of Pinocchio's articulated-body algorithm, called from Python [us]."""
    engine, random = PinocchioEngine(mechanism), np.random.default_rng(5)
    q, v, tau = random.normal(size=(3, engine.model.nv))
    once = partial(pin.aba, engine.model, engine.data, q, v, tau)
    contender = Contender(lambda: [once() for _ in range(PIN_CALLS)], PIN_CALLS)
    return us(interleaved({"aba": contender}, rounds)["aba"])
