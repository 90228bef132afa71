"""The function that evaluates states stored one a row, by the function for blocks of them.

    void rows(int64_t states, const double** in, const int64_t* strides, double** out, double* x,
    double* y)

in[i] is the first row of input i, strides[i] the doubles from one row to the next (0: the same row
for all states); out[i] is the first row of output i, rows without gaps. x and y have room for one
block. The last state fills up the last block, so that its row is written several times with the
same numbers.
"""

from collections.abc import Collection

from linkwork.kernels import transposed
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program

LONG = 256  # numbers a row that are moved one by one


def rows_text(program: Program, machine: Machine) -> str:
    """Return the LLVM function `rows` of a program; the module has to define `batch` as well."""
    lines = Lines(machine.lanes)
    lines.do("%last = add i64 %states, -1")
    lines.do("%some = icmp sgt i64 %states, 0")
    # Whether rows of the inputs lie without gaps: then whole blocks are transposed. A row that all
    # states share is moved once.
    dense, apart = "true", {}
    for k, (size, start) in enumerate(_placed(program.inputs)):
        stride = _entry(lines, "i64", "%strides", k)
        shared = lines.let(f"icmp eq i64 {stride}, 0")
        apart[k] = lines.let(f"icmp eq i64 {stride}, {size}")
        known = lines.let(f"or i1 {shared}, {apart[k]}")
        dense = lines.let(f"and i1 {dense}, {known}")
        count = lines.let(f"select i1 {shared}, i64 {size}, i64 0")
        rows, place = _entry(lines, "ptr", "%in", k), lines.at("%x", start)
        lines.do(f"call void @gather(i64 {count}, ptr {rows}, i64 0, i64 0, i64 0, ptr {place})")
    lines.do("br i1 %some, label %block, label %done")
    lines.label("block")
    lines.do("%first = phi i64 [ 0, %entry ], [ %first.next, %onward ]")
    lines.do(f"%first.next = add i64 %first, {machine.lanes}")
    whole = lines.let("icmp sle i64 %first.next, %states")
    lines.do(f"br i1 {lines.let(f'and i1 {dense}, {whole}')}, label %whole, label %single")
    lines.label("whole")
    read = {int(node.value) for node in program.nodes if node.op == "input"}
    for k, (size, start) in enumerate(_placed(program.inputs)):
        own = {place - start for place in read if start <= place < start + size}
        lines.do(f"br i1 {apart[k]}, label %apart.{k}, label %moved.{k}")
        lines.label(f"apart.{k}")
        _move_whole(lines, "gather", _rows_from(lines, "%in", k, size), size, ("%x", start), own)
        lines.do(f"br label %moved.{k}")
        lines.label(f"moved.{k}")
    lines.do("call void @batch(i64 1, ptr %x, ptr %y)")
    for k, (size, start) in enumerate(_placed(program.outputs)):
        _move_whole(lines, "scatter", _rows_from(lines, "%out", k, size), size, ("%y", start))
    lines.do("br label %onward")
    lines.label("single")
    _moves(lines, "gather", "%in", "%x", [(size, None) for _, size in program.inputs])
    lines.do("call void @batch(i64 1, ptr %x, ptr %y)")
    _moves(lines, "scatter", "%out", "%y", [(size, size) for _, size in program.outputs])
    lines.do("br label %onward")
    lines.label("onward")
    lines.do("%more = icmp slt i64 %first.next, %states")
    lines.do("br i1 %more, label %block, label %done")
    lines.label("done")
    lines.do("ret void")
    pointers = "ptr %in, ptr %strides, ptr %out, ptr noalias %x, ptr noalias %y"
    head = f"void @rows(i64 %states, {pointers}) {machine.attributes}"
    return f"{moves_text(machine)}\n\n{function_text(head, lines.text)}"


def _move_whole(
    lines: Lines,
    move: str,
    rows: str,
    size: int,
    block: tuple[str, int],
    read: Collection[int] | None = None,
) -> None:
    """Append the move of a whole block of rows without gaps, into which those that are read are
    gathered; long ones are moved by the function for any rows, lest the code grow with them."""
    place = lines.at(*block)
    if size > LONG:
        given = f"i64 {size}, ptr {rows}, i64 {size}, i64 0, i64 {lines.width - 1}, ptr {place}"
        lines.do(f"call void @{move}({given})")
    elif move == "gather":
        transposed.gather(lines, rows, size, place, read)
    else:
        transposed.scatter(lines, place, size, rows)


def _placed(parts: tuple[tuple[str, int], ...]) -> list[tuple[int, int]]:
    """Return the size of each input or output, and where it begins in a block."""
    sizes = [size for _, size in parts]
    return [(size, sum(sizes[:k])) for k, size in enumerate(sizes)]


def _entry(lines: Lines, kind: str, table: str, k: int) -> str:
    place = lines.let(f"getelementptr inbounds {kind}, ptr {table}, i64 {k}")
    return lines.let(f"load {kind}, ptr {place}")


def _rows_from(lines: Lines, table: str, k: int, size: int) -> str:
    """Return where the first row of a block begins in an array whose rows have no gaps."""
    start = lines.let(f"mul i64 %first, {size}")
    base = _entry(lines, "ptr", table, k)
    return lines.let(f"getelementptr inbounds double, ptr {base}, i64 {start}")


def moves_text(machine: Machine) -> str:
    """Return the LLVM functions that move rows of states, from number `first` on and none beyond
    the last one, to vectors and back:

        void gather(int64_t n, double* rows, int64_t stride, int64_t first, int64_t last, double*
        block), and scatter
    """
    return f"{_move_text('gather', machine)}\n\n{_move_text('scatter', machine)}"


def _moves(
    lines: Lines, move: str, arrays: str, block: str, sizes: list[tuple[int, int | None]]
) -> None:
    """Append the moves between the rows of all arrays and a block; sizes: of a row, and its stride
    if that is known."""
    start = 0
    for k, (size, stride) in enumerate(sizes):
        rows = lines.let(f"getelementptr inbounds ptr, ptr {arrays}, i64 {k}")
        first = lines.let(f"load ptr, ptr {rows}")
        step = str(stride)
        if stride is None:
            step = lines.let(
                f"load i64, ptr {lines.let(f'getelementptr inbounds i64, ptr %strides, i64 {k}')}"
            )
        place = lines.at(block, start)
        lines.do(
            f"call void @{move}(i64 {size}, ptr {first}, i64 {step}, i64 %first, i64 %last, ptr "
            f"{place})"
        )
        start += size


def _move_text(name: str, machine: Machine) -> str:
    """Return the function that gathers as many rows as there are lanes, or the last one, into
    vectors, or scatters these."""
    lines = Lines(machine.lanes)
    rows = [_row(lines, lane) for lane in range(machine.lanes)]
    lines.do("%some = icmp sgt i64 %n, 0")
    lines.do("br i1 %some, label %number, label %done")
    lines.label("number")
    lines.do("%k = phi i64 [ 0, %entry ], [ %k.next, %number ]")
    places = [lines.let(f"getelementptr inbounds double, ptr {row}, i64 %k") for row in rows]
    if name == "gather":
        lines.store(
            lines.vector([lines.let(f"load double, ptr {place}") for place in places]),
            "%block",
            "%k",
        )
    else:
        for entry, place in zip(lines.entries(lines.load("%block", "%k")), places, strict=True):
            lines.do(f"store double {entry}, ptr {place}")
    lines.do("%k.next = add nuw nsw i64 %k, 1")
    lines.do("%more = icmp slt i64 %k.next, %n")
    lines.do("br i1 %more, label %number, label %done")
    lines.label("done")
    lines.do("ret void")
    head = (
        f"internal void @{name}(i64 %n, ptr %rows, i64 %stride, i64 %first, i64 %last, ptr "
        "%block) noinline"
    )
    return function_text(f"{head} {machine.attributes}", lines.text)


def _row(lines: Lines, lane: int) -> str:
    """Return where the row of a lane begins, the last one's for lanes beyond it."""
    own = lines.let(f"add i64 %first, {lane}")
    within = lines.let(f"icmp slt i64 {own}, %last")
    row = lines.let(f"select i1 {within}, i64 {own}, i64 %last")
    return lines.let(
        f"getelementptr inbounds double, ptr %rows, i64 {lines.let(f'mul i64 {row}, %stride')}"
    )
