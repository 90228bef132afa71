"""A CasADi function as a straight-line program in static single assignment.

CasADi evaluates an SX function as a list of instructions on a work vector whose slots are reused.
`trace` walks that list once and names every intermediate value by its position instead:

    node k:  op_k(node i, node j),   i, j < k

so that a program is a tuple of nodes and the positions of its results. Inputs and outputs are
dense, column-major, and concatenated in order; a structural zero of a sparse output is the constant
0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from linkwork.errors import LinkworkError


class KernelError(LinkworkError):
    """Refuse a function that cannot be compiled, or an argument that does not fit, in one
    sentence."""


class Operation(NamedTuple):
    """One value of a program: `op` applied to the values at the positions `args`.

    `value` is the number of a "const" and the position in the flat input vector of an "input"; 0
    otherwise.
    """

    op: str
    args: tuple[int, ...] = ()
    value: float = 0


@dataclass(frozen=True)
class Program:
    """A straight-line program.

    inputs, outputs: (name, number of doubles) of each argument and result, in order.
    nodes: the values, each after its operands.  results: position in `nodes` of each entry of the
    flat output vector.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    nodes: tuple[Operation, ...]
    results: tuple[int, ...]

    @property
    def n_in(self) -> int:
        """Number of doubles of all inputs."""
        return sum(size for _, size in self.inputs)

    @property
    def n_out(self) -> int:
        """Number of doubles of all outputs."""
        return sum(size for _, size in self.outputs)

    @property
    def operations(self) -> int:
        """Number of arithmetic operations: every node but the inputs and constants."""
        return sum(node.op not in ("input", "const") for node in self.nodes)


# CasADi operations that are nodes of the same meaning, by name; the number of operands is CasADi's
# own.
_SAME = (
    "add sub mul div neg sqrt sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh "
    "exp log log1p expm1 pow fabs sign floor ceil fmin fmax fmod remainder hypot erf lt le eq "
    "ne and or not if_else_zero copysign"
)
_NAMES = {getattr(ca, "OP_" + name.upper()): name for name in _SAME.split()} | {
    ca.OP_CONSTPOW: "pow"
}

# Operations that are spelled with the others.
_SPELLED: dict[int, Callable[[Callable[..., int], list[int]], int]] = {
    ca.OP_ASSIGN: lambda emit, a: a[0],
    ca.OP_LIFT: lambda emit, a: a[0],
    ca.OP_SQ: lambda emit, a: emit("mul", a[0], a[0]),
    ca.OP_TWICE: lambda emit, a: emit("mul", a[0], emit("const", value=2.0)),
    ca.OP_INV: lambda emit, a: emit("div", emit("const", value=1.0), a[0]),
}
_KNOWN = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *_NAMES, *_SPELLED}


def signature(f: ca.Function) -> tuple[tuple[tuple[str, int], ...], tuple[tuple[str, int], ...]]:
    """Return (name, number of doubles) of every input and of every output of `f`.

    Raises KernelError where `f` is not a CasADi function of SX without free variables.
    """
    if not isinstance(f, ca.Function):
        raise KernelError(
            f"A kernel is compiled from a casadi.Function, not from {type(f).__name__}."
        )
    if not f.is_a("SXFunction"):
        raise KernelError(
            f"Function '{f.name()}' is a {f.class_name()}; only functions of SX are compiled "
            "(try expand())."
        )
    if f.has_free():
        free = ", ".join(f.get_free())
        raise KernelError(
            f"Function '{f.name()}' has free variables ({free}); every symbol has to be an input."
        )
    return (
        tuple((f.name_in(i), f.numel_in(i)) for i in range(f.n_in())),
        tuple((f.name_out(i), f.numel_out(i)) for i in range(f.n_out())),
    )


def refuse_unknown(f: ca.Function) -> None:
    """Raise KernelError where a function uses an operation that cannot be compiled."""
    for code in sorted({f.instruction_id(k) for k in range(f.n_instructions())} - _KNOWN):
        raise KernelError(
            f"Function '{f.name()}' uses the operation {_name_of(code)}, which cannot be compiled."
        )


def trace(f: ca.Function) -> Program:
    """Walk the instructions of `f` once and return them as a program.

    Raises KernelError as `signature` and `refuse_unknown` do.
    """
    inputs, outputs = signature(f)
    input_slots = _dense_slots([f.sparsity_in(i) for i in range(f.n_in())])
    output_slots = _dense_slots([f.sparsity_out(i) for i in range(f.n_out())])
    nodes: list[Operation] = []

    def emit(op: str, *args: int, value: float = 0) -> int:
        nodes.append(Operation(op, args, value))
        return len(nodes) - 1

    zero = emit("const", value=0.0)
    results = [zero] * sum(size for _, size in outputs)
    work = [zero] * f.sz_w()
    for k in range(f.n_instructions()):
        code, operands = f.instruction_id(k), f.instruction_input(k)
        targets = f.instruction_output(k)
        if code == ca.OP_INPUT:
            work[targets[0]] = emit("input", value=input_slots[operands[0]][operands[1]])
        elif code == ca.OP_OUTPUT:
            results[output_slots[targets[0]][targets[1]]] = work[operands[0]]
        elif code == ca.OP_CONST:
            work[targets[0]] = emit("const", value=f.instruction_constant(k))
        elif code in _NAMES:
            work[targets[0]] = emit(_NAMES[code], *(work[i] for i in operands))
        elif code in _SPELLED:
            work[targets[0]] = _SPELLED[code](emit, [work[i] for i in operands])
        else:
            refuse_unknown(f)
    return Program(f.name(), inputs, outputs, tuple(nodes), tuple(results))


def _dense_slots(sparsities: list[ca.Sparsity]) -> list[list[int]]:
    """Return, for each argument, the position in the flat dense vector of each of its structural
    nonzeros."""
    slots, start = [], 0
    for sparsity in sparsities:
        slots.append([start + k for k in sparsity.find()])
        start += sparsity.numel()
    return slots


def _name_of(code: int) -> str:
    names = (name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == code)
    return next(names, f"number {code}")
