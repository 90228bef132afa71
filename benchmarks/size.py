"""How much code forward dynamics is: operations as traced and as compiled, and machine
instructions."""

from __future__ import annotations

import re
from dataclasses import dataclass

from linkwork.equations import Equations, functions
from linkwork.kernels.listing import instruction_count, listing
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.program import trace
from linkwork.kernels.simplify import simplify

from benchmarks.table import Figure

AVX512 = Machine(
    "x86_64-unknown-linux-gnu",
    "sapphirerapids",
    "+avx2,+fma,+avx512f,+avx512dq,+avx512vl,+avx512bw",
)


@dataclass(frozen=True)
class Size:
    """Hold the counts of one kernel.

    traced: instructions of the CasADi function, inputs and outputs included; operations: after
        simplification
    one, batch: machine instructions for one state and for `lanes` states; wide: for 8 states, as
        emitted for AVX-512
    flops: floating-point operations of each lane
    """

    traced: int
    operations: int
    one: int
    batch: int
    lanes: int
    wide: int
    flops: int

    def figures(self, bound: float) -> list[Figure]:
        """Return all counts but the last, with the bound promised for the traced instructions."""
        return [
            Figure(
                "instructions of the traced function, inputs and outputs included",
                self.traced,
                "",
                bound,
            ),
            Figure("arithmetic operations compiled", self.operations),
            Figure("machine instructions, one lane", self.one),
            Figure(f"machine instructions, {self.lanes} lanes", self.batch),
            Figure("machine instructions, 8 lanes, emitted for AVX-512, not run", self.wide),
        ]


def size(equations: Equations) -> Size:
    """Count what forward dynamics takes in these equations."""
    traced, machine = functions.motion(equations), this_machine()
    program = simplify(trace(traced))
    batch = listing(program, machine, "batch")
    return Size(
        traced=traced.n_instructions(),
        operations=program.operations,
        one=instruction_count(listing(program, machine, "one")),
        batch=instruction_count(batch),
        lanes=machine.lanes,
        wide=instruction_count(listing(program, AVX512, "batch")),
        flops=floating_point_operations(batch),
    )


def floating_point_operations(text: str) -> int:
    """Return the floating-point operations of each lane in a listing: an FMA counts two."""
    fused = len(re.findall(r"\bvfn?m(?:add|sub)\w*[ps]d\b", text))
    plain = len(re.findall(r"\bv?(?:add|sub|mul|div|sqrt|min|max)[ps]d\b", text))
    return 2 * fused + plain
