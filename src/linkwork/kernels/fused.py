"""Products that are rounded together with the sum or the difference that they go into.

    add(mul(a, b), c) -> fma(a, b, c) = a b + c
    sub(mul(a, b), c) -> fms(a, b, c) = a b - c
    sub(c, mul(a, b)) -> fnma(a, b, c) = c - a b

where nothing else needs the product; of two products the first one. So it is decided here, and not
by whoever carries a program out: machine code, the interpreter of tapes and exported C come to the
same bits.
"""

from collections import Counter
from dataclasses import replace

from linkwork.kernels.program import Operation, Program

FUSED = {"add": ("fma", "fma"), "sub": ("fms", "fnma")}  # by which of the two is the product
NEGATED = {"fma": (False, False, False), "fms": (False, False, True), "fnma": (True, False, False)}


def fused(program: Program, has_fma: bool = True) -> Program:
    """Return a program with the products fused, where one instruction does so."""
    if not has_fma:
        return program
    nodes = program.nodes
    uses = Counter(program.results)
    for node in nodes:
        uses.update(node.args)

    def once(k: int) -> bool:
        return nodes[k].op == "mul" and uses[k] == 1

    found: list[Operation] = []
    for node in nodes:
        if node.op in FUSED and (taken := [*map(once, node.args)]) != [False, False]:
            product, other = node.args if taken[0] else node.args[::-1]
            op = FUSED[node.op][not taken[0]]
            uses[product] = 0
            found.append(Operation(op, (*nodes[product].args, other)))
        else:
            found.append(node)
    # The products themselves are left out.
    kept = [k for k, node in enumerate(nodes) if node.op != "mul" or uses[k]]
    places = {k: place for place, k in enumerate(kept)}
    return replace(
        program,
        nodes=tuple(
            Operation(op, tuple([places[a] for a in args]), value)
            for op, args, value in map(found.__getitem__, kept)
        ),
        results=tuple(places[k] for k in program.results),
    )
