"""An interpreter of tapes: code that evaluates any program at once, while its own is not worth the
time that compiling it takes.

    void interpret(const double* in, double* out, int64_t* tape)

It does what machine code does, operation by operation, with the same roundings, so that the results
are the same to the last bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache

import casadi as ca
import numpy as np

from linkwork.kernels import angles, cache, elementary
from linkwork.kernels.body import LIBRARY, OperationValues
from linkwork.kernels.bound import BoundFunction
from linkwork.kernels.compile import Code, shared_code
from linkwork.kernels.fused import fused
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.module import Module, entry_of, loaded, uncollected
from linkwork.kernels.program import Operation, Program
from linkwork.kernels.tape import ARITY, CODES, HEAD, tape
from linkwork.patience import announced

LONG = 2000  # instructions that take longer to compile than to tell on a tape
PAYS = 100_000  # evaluations that take as long as compiling does
NAME = "interpret"
ANGLES = "sin", "cos"
LIBC = "declare ptr @malloc(i64)\ndeclare void @free(ptr)\ndeclare ptr @memcpy(ptr, ptr, i64)"


class Interpreted(BoundFunction):
    """A program's tape with the interpreter, until there is machine code: its address, of
    void(const double* in, double* out), stays the same.

    operations: of the program
    """

    def __init__(self, tape: np.ndarray, n_in: int, n_out: int, operations: int):
        super().__init__(interpreter(this_machine()).addresses[NAME], tape, n_in, n_out)
        self.operations = operations

    @property
    def evaluations(self) -> int:
        """How often the tape was evaluated."""
        return self._table.item(0)


def found_or_told(
    f: ca.Function, program: Callable[[], Program], n_in: int, n_out: int
) -> Module | Interpreted:
    """Return the code of a function for one state, if it was compiled before, else its tape.

    program: makes the function's program, which is needed where neither is in the cache.
    """
    start, told = time.perf_counter(), f.serialize()
    content = cache.read(entry_of(told, "one"))
    if content is not None:
        return loaded(content, "one", start)

    def on_tape() -> bytes:
        with announced(f"preparing {f.name()}"), uncollected():
            whole = program()
            words = tape(fused(whole, this_machine().has_fma))
            return np.array([whole.operations, *words], np.int64).tobytes()

    content, _ = cache.kept(entry_of(told, "tape"), on_tape)
    words = np.frombuffer(content, np.int64).copy()
    return Interpreted(words[1:], n_in, n_out, words.item(0))


@lru_cache
def interpreter(machine: Machine) -> Code:
    """Return the interpreter for a machine, compiled or taken from the cache."""
    return shared_code(interpreter_text(machine), machine, (NAME,))


def interpreter_text(machine: Machine) -> str:
    """Return the LLVM module of the interpreter."""
    lines = Lines(1)
    _begin(lines)
    # Run by run: each operation goes on to the next run after its last one.
    lines.label("next")
    run = lines.let("load ptr, ptr %run")
    code, count = (lines.let(f"load i64, ptr {_behind(lines, run, k)}") for k in range(2))
    lines.do(f"store ptr {_behind(lines, run, 2)}, ptr %run")
    first, target = (lines.let(f"load ptr, ptr %{name}") for name in ("operand", "target"))
    cases = " ".join(f"i64 {CODES[op]}, label %{op}" for op in ARITY)
    lines.do(f"switch i64 {code}, label %results [ {cases} ]")
    for op, arity in ARITY.items():
        _operations(lines, op, arity, (count, first, target), machine)
    _end(lines, first)
    # The C library's functions.
    declared = [
        f"declare double @{name}({', '.join(['double'] * arity)})"
        for name, arity in LIBRARY.items()
    ]
    head = f"void @{NAME}(ptr noalias %in, ptr noalias %out, ptr noalias %tape) nounwind"
    return "\n\n".join([LIBC, *declared, function_text(head, lines.text)]) + "\n"


def _begin(lines: Lines) -> None:
    """Append the count of evaluations, and what lies in the work at first."""
    lines.do("%counted = atomicrmw add ptr %tape, i64 1 monotonic")
    size, constants, inputs, start, _ = (
        lines.let(f"load i64, ptr {_behind(lines, '%tape', k)}") for k in range(1, HEAD)
    )
    for name in ("run", "operand", "target"):
        lines.do(f"%{name} = alloca ptr")
    lines.do(f"%work = call ptr @malloc(i64 {size})")
    numbers = _behind(lines, "%tape", HEAD)
    rest = lines.let(f"getelementptr i8, ptr %work, i64 {constants}")
    lines.do(f"call ptr @memcpy(ptr %work, ptr {numbers}, i64 {constants})")
    lines.do(f"call ptr @memcpy(ptr {rest}, ptr %in, i64 {inputs})")
    for name, base, offset in (
        ("run", numbers, constants),
        ("operand", "%tape", start),
        ("target", rest, inputs),
    ):
        place = lines.let(f"getelementptr i8, ptr {base}, i64 {offset}")
        lines.do(f"store ptr {place}, ptr %{name}")
    lines.do("br label %next")


def _operations(
    lines: Lines, op: str, arity: int, begin: tuple[str, str, str], machine: Machine
) -> None:
    """Append the loop over a run of an operation.

    begin: how many, where their operands are told, and where their values go
    """
    names = [f"%{op}.{name}" for name in ("left", "operand", "target")]
    lines.label(op)
    for name, kind, value in zip(names, ("i64", "ptr", "ptr"), begin, strict=True):
        lines.do(f"{name} = phi {kind} [ {value}, %next ], [ {name}.next, %{op}.stored ]")
    left, operand, target = names
    value = _Step(lines, op, arity, operand).value(machine)
    lines.do(f"store double {value}, ptr {target}")
    lines.do(f"br label %{op}.stored")
    lines.label(f"{op}.stored")
    lines.do(f"{operand}.next = getelementptr i32, ptr {operand}, i64 {arity}")
    lines.do(f"{target}.next = getelementptr double, ptr {target}, i64 1")
    lines.do(f"{left}.next = add i64 {left}, -1")
    more = lines.let(f"icmp ne i64 {left}.next, 0")
    lines.do(f"br i1 {more}, label %{op}, label %{op}.done")
    lines.label(f"{op}.done")
    lines.do(f"store ptr {operand}.next, ptr %operand")
    lines.do(f"store ptr {target}.next, ptr %target")
    lines.do("br label %next")


class _Step(OperationValues):
    """The code of one operation on values that a tape tells."""

    def __init__(self, lines: Lines, op: str, arity: int, operand: str):
        operands = [Operation("value") for _ in range(arity)]
        super().__init__(lines, (*operands, Operation(op, tuple(range(arity)))))
        self._operand, self._op = operand, op

    def value(self, machine: Machine) -> str:
        """Append the operation and return its value."""
        last = len(self.nodes) - 1
        if self._op in ANGLES:
            return self._turned_by(self.number(0), machine)
        self._compute(last, self.nodes[last])
        return self.number(last)

    def _fetched(self, k: int) -> str:
        return _at(self.lines, self._operand, k)

    def _turned_by(self, angle: str, machine: Machine) -> str:
        """Append a sine or a cosine as `angles` finds them."""
        lines, op = self.lines, self._op
        near = elementary.sine_and_cosine(lines, angle, machine.has_fma)[ANGLES.index(op)]
        bound = lines.constant(angles.largest(machine))
        small = lines.compare("ole", lines.call("fabs", angle), bound)
        lines.do(f"br i1 {small}, label %{op}.found, label %{op}.far")
        lines.label(f"{op}.far")
        far = lines.let(f"call double @{op}(double {angle})")
        lines.do(f"br label %{op}.found")
        lines.label(f"{op}.found")
        return lines.phi(near, op, far, f"{op}.far")


def _end(lines: Lines, first: str) -> None:
    """Append the loop over the results, which are told from `first` on."""
    lines.label("results")
    count = lines.let(f"load i64, ptr {_behind(lines, '%tape', HEAD - 1)}")
    lines.do("br label %result")
    lines.label("result")
    lines.do("%k = phi i64 [ 0, %results ], [ %k.next, %write ]")
    more = lines.let(f"icmp ult i64 %k, {count}")
    lines.do(f"br i1 {more}, label %write, label %done")
    lines.label("write")
    lines.store(_at(lines, first, "%k"), "%out", "%k")
    lines.do("%k.next = add i64 %k, 1")
    lines.do("br label %result")
    lines.label("done")
    lines.do("call void @free(ptr %work)")
    lines.do("ret void")


def _at(lines: Lines, indices: str, k: int | str) -> str:
    """Append the value that index k of those at a pointer tells."""
    place = lines.let(f"getelementptr i32, ptr {indices}, i64 {k}")
    index = lines.let(f"load i32, ptr {place}, align 4")
    return lines.load("%work", lines.let(f"zext i32 {index} to i64"))


def _behind(lines: Lines, pointer: str, words: int) -> str:
    return lines.let(f"getelementptr i64, ptr {pointer}, i64 {words}")
