"""A handler of XLA's foreign functions, written in LLVM instructions: no compiler is asked for on
the user's machine.

    XLA_FFI_Error* handler(XLA_FFI_CallFrame* frame)

It tells XLA for which version of the interface it stands (the extension of a frame that asks for
metadata), reads where arguments and results lie, sees to it that they are doubles of the sizes that
are meant, and hands the states, as many at a time as a vector register holds, to

    int64_t block(int64_t states, const double** in, const int64_t* strides, double** out)

which returns a bit for each state whose rates do not determine the motion, and 32 bits further up
one for each that is not finite. Where there is a quicker way, bool chunk(in, strides, out), it
takes CHUNK states and tells only whether all is well; blocks tell what is not. The leading
dimensions of arguments are those of the results; where they are all 1 every state has the same
numbers.
Source: xla/ffi/api/c_api.h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine

WEAK, UNDEFINED = 0, 32  # first bits of the states that are refused, by why

# Where the fields of XLA's structures lie, in bytes.
FRAME = {"extension": 8, "api": 16, "args": 72, "rets": 112}
BUFFER = {"dtype": 16, "data": 24, "rank": 32, "dims": 40}
API = {"major": 32, "minor": 36, "error_create": 48}
EXTENSION = {"type": 8, "metadata": 24}
METADATA = {"major": 24, "minor": 28, "traits": 32}
CHUNK = 256  # states that `chunk` evaluates
METADATA_ASKED, F64, INVALID, FAILED = 1, 12, 3, 9
ERROR_BYTES = 28
DIGITS = 20  # of the longest whole number


@dataclass(frozen=True)
class Sentences:
    """Hold what XLA is told: of arguments that do not fit, and of a state for which the function is
    not defined, by why; its number is written after that."""

    misfit: str
    weak: str
    undefined: str


def handler_text(
    inputs: Sequence[int],
    outputs: Sequence[int],
    sentences: Sentences,
    raises: bool,
    machine: Machine,
    chunks: bool = False,
) -> str:
    """Return the LLVM functions of a handler; the module has to define `block` as well, and
    `chunk` where there are chunks.

    inputs, outputs: doubles of one state; raises: whether states that are refused are errors, or
        filled with NaN
    """
    texts = asdict(sentences)
    parts = [_text(name, text) for name, text in texts.items()]
    parts += [_leading_text(), _error_text(), _fill_text()]
    parts += [_numbered_text(name, text) for name, text in texts.items() if name != "misfit"]
    lines = Lines(machine.lanes)
    _answer_metadata(lines)
    _read(lines, "args", inputs, "in")
    _read(lines, "rets", outputs, "out")
    _count(lines, inputs, outputs)
    _blocks(lines, inputs, outputs, raises, chunks)
    lines.label("misfit")
    misfit = lines.let(f"call ptr @error(ptr %frame, ptr @misfit, i32 {INVALID})")
    lines.do(f"ret ptr {misfit}")
    parts.append(function_text(f"ptr @handler(ptr %frame) {machine.attributes}", lines.text))
    return "\n\n".join(parts) + "\n"


def _field(lines: Lines, base: str, offset: int, kind: str) -> str:
    place = lines.let(f"getelementptr inbounds i8, ptr {base}, i64 {offset}")
    return lines.let(f"load {kind}, ptr {place}")


def _answer_metadata(lines: Lines) -> None:
    """Append the answer to a frame that asks for metadata: the version of whoever asks."""
    extension = _field(lines, "%frame", FRAME["extension"], "ptr")
    lines.do(f"%none = icmp eq ptr {extension}, null")
    lines.do("br i1 %none, label %arguments, label %extended")
    lines.label("extended")
    kind = _field(lines, extension, EXTENSION["type"], "i32")
    lines.do(f"%asked = icmp eq i32 {kind}, {METADATA_ASKED}")
    lines.do("br i1 %asked, label %metadata, label %arguments")
    lines.label("metadata")
    api = _field(lines, "%frame", FRAME["api"], "ptr")
    metadata = _field(lines, extension, EXTENSION["metadata"], "ptr")
    for name in ("major", "minor"):
        version = _field(lines, api, API[name], "i32")
        place = lines.let(f"getelementptr inbounds i8, ptr {metadata}, i64 {METADATA[name]}")
        lines.do(f"store i32 {version}, ptr {place}")
    place = lines.let(f"getelementptr inbounds i8, ptr {metadata}, i64 {METADATA['traits']}")
    lines.do(f"store i32 0, ptr {place}")
    lines.do("ret ptr null")
    lines.label("arguments")


def _read(lines: Lines, which: str, sizes: Sequence[int], name: str) -> None:
    """Append the reading of as many buffers as there are sizes: where their numbers lie, and how
    many states they have."""
    lines.do(f"%{name} = alloca [{max(len(sizes), 1)} x ptr]")
    table = _field(lines, "%frame", FRAME[which], "ptr")
    for k, size in enumerate(sizes):
        buffer = _field(lines, table, 8 * k, "ptr")
        data = _field(lines, buffer, BUFFER["data"], "ptr")
        place = lines.let(f"getelementptr inbounds ptr, ptr %{name}, i64 {k}")
        lines.do(f"store ptr {data}, ptr {place}")
        lines.do(f"%{name}.{k}.states = call i64 @leading(ptr {buffer}, i64 {size})")


def _count(lines: Lines, inputs: Sequence[int], outputs: Sequence[int]) -> None:
    """Append the strides of the inputs, and the way out where sizes do not fit."""
    lines.do(f"%strides = alloca [{max(len(inputs), 1)} x i64]")
    fits = lines.let("icmp sge i64 %out.0.states, 0")
    for k in range(1, len(outputs)):
        same = lines.let(f"icmp eq i64 %out.{k}.states, %out.0.states")
        fits = lines.let(f"and i1 {fits}, {same}")
    for k, size in enumerate(inputs):
        own = lines.let(f"icmp eq i64 %in.{k}.states, %out.0.states")
        shared = lines.let(f"icmp eq i64 %in.{k}.states, 1")
        fits = lines.let(f"and i1 {fits}, {lines.let(f'or i1 {own}, {shared}')}")
        stride = lines.let(f"select i1 {own}, i64 {size}, i64 0")
        place = lines.let(f"getelementptr inbounds i64, ptr %strides, i64 {k}")
        lines.do(f"store i64 {stride}, ptr {place}")
    lines.do(f"br i1 {fits}, label %sized, label %misfit")
    lines.label("sized")
    some = lines.let("icmp sgt i64 %out.0.states, 0")
    lines.do(f"br i1 {some}, label %loop, label %done")


def _blocks(
    lines: Lines, inputs: Sequence[int], outputs: Sequence[int], raises: bool, chunks: bool
) -> None:
    """Append the loop over blocks of states, and what is told of those that are refused."""
    lanes = lines.width
    lines.label("loop")
    lines.do("%first = phi i64 [ 0, %sized ], [ %next, %onward ], [ %first, %unwell ]")
    lines.do("%single = phi i64 [ 0, %sized ], [ %single, %onward ], [ %end, %unwell ]")
    left = lines.let("sub i64 %out.0.states, %first")
    # A chunk; where not all of it is well, blocks up to its end.
    lines.do(f"%end = add i64 %first, {CHUNK}")
    if chunks:
        enough = lines.let(f"icmp sge i64 {left}, {CHUNK}")
        untried = lines.let("icmp sge i64 %first, %single")
        whole = lines.let(f"and i1 {enough}, {untried}")
        lines.do(f"br i1 {whole}, label %chunk, label %block")
        lines.label("chunk")
        lines.do("%well = call i1 @chunk(ptr %in, ptr %strides, ptr %out)")
        lines.do("br i1 %well, label %onward, label %unwell")
    else:
        lines.do("br i1 true, label %block, label %unwell")
    lines.label("unwell")
    lines.do("br label %loop")
    # As many states as there are lanes, or those that are left.
    lines.label("block")
    lines.do(f"%few = call i64 @llvm.smin.i64(i64 {left}, i64 {lanes})")
    lines.do("%refused = call i64 @block(i64 %few, ptr %in, ptr %strides, ptr %out)")
    good = lines.let("icmp eq i64 %refused, 0")
    lines.do(f"br i1 {good}, label %onward, label %bad")
    # Of refused ones the first is told, or all are filled with NaN.
    lines.label("bad")
    if raises:
        weak = lines.let(f"and i64 %refused, {2**UNDEFINED - 1}")
        lines.do(f"%is.weak = icmp ne i64 {weak}, 0")
        lines.do("br i1 %is.weak, label %weak, label %undefined")
        for name, shift in (("weak", WEAK), ("undefined", UNDEFINED)):
            lines.label(name)
            own = lines.let(f"lshr i64 %refused, {shift}")
            lane = lines.let(f"call i64 @llvm.cttz.i64(i64 {own}, i1 false)")
            state = lines.let(f"add i64 %first, {lane}")
            error = lines.let(f"call ptr @numbered.{name}(ptr %frame, i64 {state})")
            lines.do(f"ret ptr {error}")
    else:
        for k, size in enumerate(outputs):
            place = lines.let(f"getelementptr inbounds ptr, ptr %out, i64 {k}")
            rows = lines.let(f"load ptr, ptr {place}")
            lines.do(f"call void @fill(i64 %refused, i64 %few, ptr {rows}, i64 {size})")
        lines.do("br label %onward")
    # On to the next rows.
    lines.label("onward")
    ways = ["block", *([] if raises else ["bad"])]
    counts = [f"[ {lanes}, %{way} ]" for way in ways] + [f"[ {CHUNK}, %chunk ]"] * chunks
    lines.do(f"%done.states = phi i64 {', '.join(counts)}")
    for k in range(len(inputs)):
        place = lines.let(f"getelementptr inbounds i64, ptr %strides, i64 {k}")
        stride = lines.let(f"load i64, ptr {place}")
        _advance(lines, "in", k, lines.let(f"mul i64 {stride}, %done.states"))
    for k, size in enumerate(outputs):
        _advance(lines, "out", k, lines.let(f"mul i64 {size}, %done.states"))
    lines.do("%next = add i64 %first, %done.states")
    more = lines.let("icmp slt i64 %next, %out.0.states")
    lines.do(f"br i1 {more}, label %loop, label %done")
    lines.label("done")
    lines.do("ret ptr null")


def _advance(lines: Lines, name: str, k: int, doubles: str) -> None:
    place = lines.let(f"getelementptr inbounds ptr, ptr %{name}, i64 {k}")
    rows = lines.let(f"load ptr, ptr {place}")
    after = lines.let(f"getelementptr double, ptr {rows}, i64 {doubles}")
    lines.do(f"store ptr {after}, ptr {place}")


def _leading_text() -> str:
    """Return the function that tells how many states a buffer of doubles has: the product of its
    dimensions but the last, which is `size`; -1 where it is another one."""
    # A double array whose last dimension is the size that is meant; then the product of the others.
    return f"""define internal i64 @leading(ptr %buffer, i64 %size) noinline {{
entry:
  %kind.at = getelementptr inbounds i8, ptr %buffer, i64 {BUFFER["dtype"]}
  %kind = load i32, ptr %kind.at
  %double = icmp eq i32 %kind, {F64}
  %rank.at = getelementptr inbounds i8, ptr %buffer, i64 {BUFFER["rank"]}
  %rank = load i64, ptr %rank.at
  %array = icmp sgt i64 %rank, 0
  %ok = and i1 %double, %array
  br i1 %ok, label %last, label %misfit
last:
  %dims.at = getelementptr inbounds i8, ptr %buffer, i64 {BUFFER["dims"]}
  %dims = load ptr, ptr %dims.at
  %end = sub i64 %rank, 1
  %last.at = getelementptr inbounds i64, ptr %dims, i64 %end
  %last.size = load i64, ptr %last.at
  %fits = icmp eq i64 %last.size, %size
  br i1 %fits, label %leading, label %misfit
leading:
  %k = phi i64 [ 0, %last ], [ %k.next, %more ]
  %count = phi i64 [ 1, %last ], [ %count.next, %more ]
  %through = icmp eq i64 %k, %end
  br i1 %through, label %done, label %more
more:
  %dim.at = getelementptr inbounds i64, ptr %dims, i64 %k
  %dim = load i64, ptr %dim.at
  %count.next = mul i64 %count, %dim
  %k.next = add i64 %k, 1
  br label %leading
done:
  ret i64 %count
misfit:
  ret i64 -1
}}"""


def _error_text() -> str:
    """Return the function that makes an XLA error of a text and a code."""
    return f"""define internal ptr @error(ptr %frame, ptr %text, i32 %code) noinline {{
  %args = alloca [4 x i64], align 8
  store i64 {ERROR_BYTES}, ptr %args
  %extension = getelementptr inbounds i8, ptr %args, i64 8
  store ptr null, ptr %extension
  %message = getelementptr inbounds i8, ptr %args, i64 16
  store ptr %text, ptr %message
  %errc = getelementptr inbounds i8, ptr %args, i64 24
  store i32 %code, ptr %errc
  %api.at = getelementptr inbounds i8, ptr %frame, i64 {FRAME["api"]}
  %api = load ptr, ptr %api.at
  %create.at = getelementptr inbounds i8, ptr %api, i64 {API["error_create"]}
  %create = load ptr, ptr %create.at
  %made = call ptr %create(ptr %args)
  ret ptr %made
}}"""


def _numbered_text(name: str, text: str) -> str:
    """Return the function that makes an error of a text that ends with the number of a state."""
    size = len(text.encode())
    # The text is copied, digits are counted, and written from the last one on.
    return f"""define internal ptr @numbered.{name}(ptr %frame, i64 %state) noinline {{
entry:
  %text = alloca [{size + DIGITS + 1} x i8]
  call void @llvm.memcpy.p0.p0.i64(ptr %text, ptr @{name}, i64 {size}, i1 false)
  br label %count
count:
  %rest = phi i64 [ %state, %entry ], [ %rest.next, %count ]
  %end = phi i64 [ {size}, %entry ], [ %end.next, %count ]
  %rest.next = udiv i64 %rest, 10
  %end.next = add i64 %end, 1
  %longer = icmp ne i64 %rest.next, 0
  br i1 %longer, label %count, label %ended
ended:
  %end.at = getelementptr inbounds i8, ptr %text, i64 %end.next
  store i8 0, ptr %end.at
  br label %digit
digit:
  %left = phi i64 [ %state, %ended ], [ %left.next, %digit ]
  %place = phi i64 [ %end.next, %ended ], [ %place.next, %digit ]
  %left.next = udiv i64 %left, 10
  %units = urem i64 %left, 10
  %code = add i64 %units, 48
  %byte = trunc i64 %code to i8
  %place.next = sub i64 %place, 1
  %at = getelementptr inbounds i8, ptr %text, i64 %place.next
  store i8 %byte, ptr %at
  %more = icmp ne i64 %left.next, 0
  br i1 %more, label %digit, label %done
done:
  %made = call ptr @error(ptr %frame, ptr %text, i32 {FAILED})
  ret ptr %made
}}"""


def _fill_text() -> str:
    """Return the function that writes NaN to the rows of the states that are refused."""
    return f"""define internal void @fill(i64 %refused, i64 %few, ptr %rows, i64 %size) noinline {{
entry:
  %high = lshr i64 %refused, {UNDEFINED}
  %either = or i64 %refused, %high
  br label %state
state:
  %lane = phi i64 [ 0, %entry ], [ %lane.next, %after ]
  %bits = lshr i64 %either, %lane
  %bit = trunc i64 %bits to i1
  br i1 %bit, label %number, label %after
number:
  %k = phi i64 [ 0, %state ], [ %k.next, %number ]
  %row = mul i64 %lane, %size
  %place = add i64 %row, %k
  %at = getelementptr inbounds double, ptr %rows, i64 %place
  store double 0x7FF8000000000000, ptr %at
  %k.next = add i64 %k, 1
  %more = icmp slt i64 %k.next, %size
  br i1 %more, label %number, label %after
after:
  %lane.next = add i64 %lane, 1
  %others = icmp slt i64 %lane.next, %few
  br i1 %others, label %state, label %done
done:
  ret void
}}"""


def _text(name: str, text: str) -> str:
    data = text.encode() + b"\0"
    escaped = "".join(f"\\{byte:02X}" for byte in data)
    return f'@{name} = internal constant [{len(data)} x i8] c"{escaped}"'
