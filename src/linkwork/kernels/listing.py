"""The machine instructions of a program, to be read and counted."""

import re
from collections.abc import Callable

import casadi as ca

from linkwork.kernels import cache
from linkwork.kernels.compile import assembly
from linkwork.kernels.dense import source_text
from linkwork.kernels.emit import Kind
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.module import entry_of
from linkwork.kernels.program import Program


def listing(program: Program, machine: Machine, kind: Kind) -> str:
    """Return the assembly of a function, of one kind, with all sections of a large one, and
    all that goes row by row."""
    text = assembly(source_text(program, machine, kind), machine)
    names = "single|batch|by_rows" if kind == "by_rows" else kind
    one_function = rf'^"?_?(?:{names})(?:\.\d+)?"?:.*?(?=^\s*\.size|^\.?Lfunc_end|\Z)'
    functions = re.findall(one_function, text, re.MULTILINE | re.DOTALL)
    return "".join(functions)


def instruction_count(listing: str) -> int:
    """Return the number of machine instructions in a listing."""
    return len(re.findall(r"^\t[a-z]\w*", listing, re.MULTILINE))


def kept_count(f: ca.Function, program: Callable[[], Program], kind: Kind) -> int:
    """Return the number of machine instructions of a function, of one kind, kept as its code is.

    program: makes the function's program, which is needed where the number is not in the cache.
    """

    def counted() -> bytes:
        return b"%d" % instruction_count(listing(program(), this_machine(), kind))

    content, _ = cache.kept(entry_of(f.serialize(), f"instructions, {kind}"), counted)
    return int(content)
