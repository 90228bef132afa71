"""LLVM instructions written down for one number or for a vector of them: the same text with another
type."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from linkwork.kernels.machine import Machine

INOUT = "ptr noalias nonnull readonly {}, ptr noalias nonnull {}"


@dataclass(frozen=True)
class ConstantTable:
    """Say where a function reads its constants: a table's name, and whether an entry is one number
    for all lanes."""

    name: str
    single: bool

    @classmethod
    def of(cls, function: str, machine: Machine) -> ConstantTable | None:
        """Return the table of a function, None where instructions take no operands from memory."""
        if not machine.has_memory_operands:
            return None
        return cls(f"constants.{function}", machine.has_broadcast_operands)


class Lines:
    """Instructions of one function body whose numbers are `width` doubles wide.

    number, integer, truth: the LLVM types of a value, of its bits, and of a comparison.  text: the
    instructions so far. block: the label of the block they are in.  table: that constants are read
    from, if they are (see `constant`).
    """

    def __init__(self, width: int, table: ConstantTable | None = None):
        self.width = width
        self.table = table
        self._entries: list[str] = []
        self.number = self._typed("double")
        self.integer = self._typed("i64")
        self.truth = self._typed("i1")
        self.always = self._spread("i1", "true")
        self.text: list[str] = ["entry:"]
        self.block = "entry"

    def _typed(self, scalar: str) -> str:
        return scalar if self.width == 1 else f"<{self.width} x {scalar}>"

    def of_width(self, width: int, table: ConstantTable | None = None) -> Lines:
        """Return the same instructions, to be continued with numbers of another width."""
        other = Lines(width, table)
        other.text, other.block = self.text, self.block
        return other

    def let(self, instruction: str) -> str:
        """Append an instruction and return the name of its value."""
        name = f"%v{len(self.text)}"
        self.text.append(f"{name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """Append an instruction that has no value."""
        self.text.append(instruction)

    def label(self, block: str) -> None:
        """Begin a block."""
        self.text.append(f"{block}:")
        self.block = block

    def constant(self, value: float) -> str:
        """Return a constant for all lanes.

        With a table it is an entry of its own for each use, which the instruction that uses it can
        take from memory; an entry of several uses would occupy a register.
        """
        single = "0x" + struct.pack(">d", value).hex()
        if self.table is None:
            return self._spread("double", single)
        if self.width == 1 or not self.table.single:
            self._entries.append(f"{self.number} {self._spread('double', single)}")
            return self.load(f"@{self.table.name}", len(self._entries) - 1)
        self._entries.append(f"double {single}")
        return self.single(f"@{self.table.name}", len(self._entries) - 1)

    def single(self, pointer: str, k: int | str) -> str:
        """Read single number k of those at `pointer` into all lanes."""
        place = self.let(f"getelementptr inbounds double, ptr {pointer}, i64 {k}")
        first = self.let(f"load double, ptr {place}, align 8")
        if self.width == 1:
            return first
        vector = self.let(f"insertelement {self.number} poison, double {first}, i64 0")
        lanes = f"<{self.width} x i32> zeroinitializer"
        return self.let(f"shufflevector {self.number} {vector}, {self.number} poison, {lanes}")

    def table_text(self) -> str:
        """Return the definition of the table, if it has entries."""
        if self.table is None or not self._entries:
            return ""
        number = "double" if self.table.single else self.number
        kind = f"[{len(self._entries)} x {number}]"
        return (
            f"@{self.table.name} = internal constant {kind} [{', '.join(self._entries)}], align "
            "64\n\n"
        )

    def whole(self, value: int) -> str:
        """Return a constant integer for all lanes."""
        return self._spread("i64", str(value))

    def _spread(self, scalar: str, text: str) -> str:
        return text if self.width == 1 else f"splat ({scalar} {text})"

    def at(self, pointer: str, k: int | str) -> str:
        """Return the address of number k of those at `pointer`."""
        return self.let(f"getelementptr inbounds {self.number}, ptr {pointer}, i64 {k}")

    def load(self, pointer: str, k: int | str) -> str:
        """Read number k of those at `pointer`."""
        return self.load_at(self.at(pointer, k))

    def load_at(self, address: str) -> str:
        """Read the number at an address."""
        return self.let(f"load {self.number}, ptr {address}, align {8 * self.width}")

    def store(self, value: str, pointer: str, k: int | str) -> None:
        """Write number k of those at `pointer`."""
        self.store_at(value, self.at(pointer, k))

    def store_at(self, value: str, address: str) -> None:
        """Write the number at an address."""
        self.do(f"store {self.number} {value}, ptr {address}, align {8 * self.width}")

    def vector(self, numbers: list[str]) -> str:
        """Return the vector of single numbers, zeros after the last."""
        result = "zeroinitializer"
        for k, number in enumerate(numbers):
            result = self.let(f"insertelement {self.number} {result}, double {number}, i64 {k}")
        return result

    def entries(self, vector: str) -> list[str]:
        """Return the single numbers of a vector."""
        return [
            self.let(f"extractelement {self.number} {vector}, i64 {k}") for k in range(self.width)
        ]

    def call(self, intrinsic: str, *args: str) -> str:
        """Call an LLVM intrinsic on numbers."""
        suffix = "f64" if self.width == 1 else f"v{self.width}f64"
        operands = ", ".join(f"{self.number} {a}" for a in args)
        return self.let(f"call {self.number} @llvm.{intrinsic}.{suffix}({operands})")

    def op(self, name: str, a: str, b: str) -> str:
        """Append a floating-point instruction of two numbers: fadd, fsub, fmul, fdiv."""
        return self.let(f"{name} {self.number} {a}, {b}")

    def negative(self, x: str) -> str:
        return self.let(f"fneg {self.number} {x}")

    def bits(self, name: str, a: str, b: str) -> str:
        """Append an integer instruction of two values: and, xor, shl."""
        return self.let(f"{name} {self.integer} {a}, {b}")

    def compare(self, predicate: str, a: str, b: str) -> str:
        return self.let(f"fcmp {predicate} {self.number} {a}, {b}")

    def select(self, condition: str, a: str, b: str) -> str:
        """Return a where the condition holds, else b.

        A single one may not become a branch, which would part products from the sums that take
        them up and change what is rounded.
        """
        kept = ", !unpredictable !{}" if self.width == 1 else ""
        return self.let(
            f"select {self.truth} {condition}, {self.number} {a}, {self.number} {b}{kept}"
        )

    def phi(self, a: str, block_a: str, b: str, block_b: str) -> str:
        """Return a where the block is entered from block a, b where it is entered from block b."""
        return self.let(f"phi {self.number} [ {a}, %{block_a} ], [ {b}, %{block_b} ]")

    def as_integer(self, x: str) -> str:
        return self.let(f"bitcast {self.number} {x} to {self.integer}")

    def as_number(self, x: str) -> str:
        return self.let(f"bitcast {self.integer} {x} to {self.number}")


def function_text(head: str, body: list[str]) -> str:
    """Return the definition of a function: its head, and its instructions and labels."""
    lines = "\n".join(line if line.endswith(":") else f"  {line}" for line in body)
    return f"define {head} {{\n{lines}\n}}"
