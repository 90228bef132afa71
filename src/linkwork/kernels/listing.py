"""The machine instructions of a program, to be read and counted."""

import re

from linkwork.kernels.compile import assembly
from linkwork.kernels.emit import module_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program


def listing(program: Program, machine: Machine, vector: bool) -> str:
    """Return the assembly of the function for blocks of states (vector) or for one state, with all sections of a large one."""
    text = assembly(module_text(program, machine, vector), machine)
    name = r'"?_?batch' if vector else r'"?_?one'
    functions = re.findall(rf"^{name}(?:\.\d+)?\"?:.*?(?=^\s*\.size|^\.?Lfunc_end|\Z)", text, re.MULTILINE | re.DOTALL)
    return "".join(functions)


def instruction_count(listing: str) -> int:
    """Return the number of machine instructions in a listing."""
    return len(re.findall(r"^\t[a-z]\w*", listing, re.MULTILINE))
