"""Products and the sums that take them up: where a kernel multiplies and adds with one rounding.

A processor that has it computes  a b + c  in one instruction, rounded once, and so do kernels
(`kernels.lines`: `contract`) wherever a product is needed by one sum alone that is computed in the
same section. C that says so by `fma` at the same places gives the same numbers, bit by bit.
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from linkwork.kernels.program import Operation, Program
from linkwork.kernels.sections import SectionPlan


class Sum(NamedTuple):
    """Hold a sum or difference that takes up the product at a position: its other term, and
    whether product and term are subtracted."""

    product: int
    term: int
    minus_product: bool
    minus_term: bool


def fused(program: Program, plan: SectionPlan) -> dict[int, Sum]:
    """Return the sums that are rounded once with a product, by their positions."""
    nodes = program.nodes
    section = {k: s for s, part in enumerate(plan.sections) for k in part.nodes}
    uses = Counter(a for node in nodes for a in node.args)
    uses.update(program.results)
    uses.update(a for part in plan.sections for a in part.angles)

    def alone(k: int, at: int) -> bool:
        return nodes[k].op == "mul" and uses[k] == 1 and section[k] == section[at]

    found: dict[int, Sum] = {}
    for k, node in enumerate(nodes):
        if node.op not in ("add", "sub") or k not in section:
            continue
        first, second = node.args
        minus, order = node.op == "sub", (first, second)
        if minus and nodes[first].op == nodes[second].op == "mul" and uses[first] > uses[second]:
            order = (second, first)
        for taken in order:
            if alone(taken, k):
                term = second if taken == first else first
                is_second = minus and taken == second
                found[k] = Sum(taken, term, is_second, minus and not is_second)
                break
    return found


def products(sums: dict[int, Sum], nodes: tuple[Operation, ...]) -> dict[int, tuple[int, int]]:
    """Return the factors of the products that sums take up, by position."""
    return {
        each.product: (nodes[each.product].args[0], nodes[each.product].args[1])
        for each in sums.values()
    }
