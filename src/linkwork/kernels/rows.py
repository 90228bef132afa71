"""The function that evaluates states stored one a row, by the function for blocks of them.

    void rows(int64_t states, const double** in, const int64_t* strides, double** out, double* x, double* y)

in[i] is the first row of input i, strides[i] the doubles from one row to the next (0: the same row for all states); out[i]
is the first row of output i, rows without gaps. x and y have room for one block. The last state fills up the last block.
"""

from linkwork.kernels.lines import function_text
from linkwork.kernels.program import Program

_COPY = """define internal void @copy(i64 %n, ptr %from, i64 %from.step, ptr %to, i64 %to.step) nounwind {
entry:
  br label %test
test:
  %k = phi i64 [ 0, %entry ], [ %k.next, %step ]
  %more = icmp slt i64 %k, %n
  br i1 %more, label %step, label %done
step:
  %i = mul i64 %k, %from.step
  %j = mul i64 %k, %to.step
  %source = getelementptr inbounds double, ptr %from, i64 %i
  %target = getelementptr inbounds double, ptr %to, i64 %j
  %x = load double, ptr %source
  store double %x, ptr %target
  %k.next = add i64 %k, 1
  br label %test
done:
  ret void
}"""


def rows_text(program: Program, lanes: int) -> str:
    """Return the LLVM function `rows` of a program; the module has to define `batch` as well."""
    text = [
        "entry:",
        "%some = icmp sgt i64 %states, 0",
        "br i1 %some, label %block, label %done",
        "block:",
        "%first = phi i64 [ 0, %entry ], [ %first.next, %stored ]",
        "%remaining = sub i64 %states, %first",
        "%last = add i64 %states, -1",
        "br label %load",
        "load:",
        "%i = phi i64 [ 0, %block ], [ %i.next, %load ]",
        "%i.row = add i64 %first, %i",
        "%i.in = icmp slt i64 %i.row, %states",
        "%row = select i1 %i.in, i64 %i.row, i64 %last",
        *_loads(program, lanes),
        "%i.next = add i64 %i, 1",
        f"%i.more = icmp slt i64 %i.next, {lanes}",
        "br i1 %i.more, label %load, label %evaluate",
        "evaluate:",
        "call void @batch(i64 1, ptr %x, ptr %y)",
        "br label %store",
        "store:",
        "%j = phi i64 [ 0, %evaluate ], [ %j.next, %store ]",
        "%j.row = add i64 %first, %j",
        *_stores(program, lanes),
        "%j.next = add i64 %j, 1",
        f"%j.in = icmp slt i64 %j.next, {lanes}",
        "%j.left = icmp slt i64 %j.next, %remaining",
        "%j.more = and i1 %j.in, %j.left",
        "br i1 %j.more, label %store, label %stored",
        "stored:",
        f"%first.next = add i64 %first, {lanes}",
        "%more = icmp slt i64 %first.next, %states",
        "br i1 %more, label %block, label %done",
        "done:",
        "ret void",
    ]
    head = "void @rows(i64 %states, ptr %in, ptr %strides, ptr %out, ptr noalias %x, ptr noalias %y) nounwind"
    return f"{_COPY}\n\n{function_text(head, text)}"


def _loads(program: Program, lanes: int) -> list[str]:
    """Copy row %row of each input into lane %i of the block %x."""
    text, start = [], 0
    for k, (_, size) in enumerate(program.inputs):
        text += [
            f"%in.{k} = getelementptr ptr, ptr %in, i64 {k}",
            f"%rows.{k} = load ptr, ptr %in.{k}",
            f"%strides.{k} = getelementptr i64, ptr %strides, i64 {k}",
            f"%stride.{k} = load i64, ptr %strides.{k}",
            f"%skip.{k} = mul i64 %row, %stride.{k}",
            f"%from.{k} = getelementptr double, ptr %rows.{k}, i64 %skip.{k}",
            f"%place.{k} = add i64 %i, {start * lanes}",
            f"%to.{k} = getelementptr double, ptr %x, i64 %place.{k}",
            f"call void @copy(i64 {size}, ptr %from.{k}, i64 1, ptr %to.{k}, i64 {lanes})",
        ]
        start += size
    return text


def _stores(program: Program, lanes: int) -> list[str]:
    """Copy lane %j of the block %y into row %j.row of each output."""
    text, start = [], 0
    for k, (_, size) in enumerate(program.outputs):
        text += [
            f"%out.{k} = getelementptr ptr, ptr %out, i64 {k}",
            f"%results.{k} = load ptr, ptr %out.{k}",
            f"%skipped.{k} = mul i64 %j.row, {size}",
            f"%target.{k} = getelementptr double, ptr %results.{k}, i64 %skipped.{k}",
            f"%lane.{k} = add i64 %j, {start * lanes}",
            f"%source.{k} = getelementptr double, ptr %y, i64 %lane.{k}",
            f"call void @copy(i64 {size}, ptr %source.{k}, i64 {lanes}, ptr %target.{k}, i64 1)",
        ]
        start += size
    return text
