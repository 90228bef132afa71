"""The function that evaluates a program once for each unit vector of its last input.

    void columns(const double* in, double* out)

in holds all inputs but the last. Of a program that gives the derivative of f along its last input,
out is the Jacobian of f, column by column: each lane of a vector has another direction. It calls
`rows`, whose states are the directions and share all other inputs.
"""

from itertools import accumulate

from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import KernelError, Program


def columns_text(program: Program, machine: Machine) -> str:
    """Return the LLVM function `columns` of a program of one output; the module has to define
    `rows` as well.

    Row k of the unit matrix begins k numbers before the 1 of (0, ..., 0, 1, 0, ..., 0).
    """
    (*_, (_, count)), one_output = program.inputs, len(program.outputs) == 1
    if not (count and one_output):
        raise KernelError(
            f"Columns of function '{program.name}' need one output and a last input that is not "
            "empty."
        )
    sizes, lines = [size for _, size in program.inputs], Lines(machine.lanes)
    zeros = ", ".join(["double 0.0"] * (count - 1))
    numbers = f"{zeros}{', ' if zeros else ''}double 1.0{', ' if zeros else ''}{zeros}"
    table = f"@units = internal constant [{2 * count - 1} x double] [{numbers}], align 64"
    # Room for one block, and the tables that `rows` reads.
    room = {
        "x": f"[{program.n_in} x {lines.number}]",
        "y": f"[{program.n_out} x {lines.number}]",
        "rows": f"[{len(sizes)} x ptr]",
        "strides": f"[{len(sizes)} x i64]",
        "columns": "[1 x ptr]",
    }
    for name, kind in room.items():
        lines.do(f"%{name} = alloca {kind}, align 64")
    # Where each input begins, and how far it is from one direction to the next.
    for k, first in enumerate(accumulate(sizes, initial=0)):
        if k == len(sizes):
            break
        last = k == len(sizes) - 1
        base, start, stride = ("@units", count - 1, -1) if last else ("%in", first, 0)
        place = lines.let(f"getelementptr inbounds double, ptr {base}, i64 {start}")
        entry = lines.let(f"getelementptr inbounds ptr, ptr %rows, i64 {k}")
        lines.do(f"store ptr {place}, ptr {entry}")
        entry = lines.let(f"getelementptr inbounds i64, ptr %strides, i64 {k}")
        lines.do(f"store i64 {stride}, ptr {entry}")
    lines.do("store ptr %out, ptr %columns")
    pointers = "ptr %rows, ptr %strides, ptr %columns, ptr %x, ptr %y"
    lines.do(f"call void @rows(i64 {count}, {pointers})")
    lines.do("ret void")
    head = f"void @columns(ptr %in, ptr %out) {machine.attributes}"
    return f"{table}\n\n{function_text(head, lines.text)}"
