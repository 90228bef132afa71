"""The code of a kernel for one state, for blocks of states, or for states side by side: from the
cache, or compiled and written there.
"""

import gc
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import casadi as ca

from linkwork.kernels import cache
from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.dense import source_text
from linkwork.kernels.emit import FUNCTIONS, Kind
from linkwork.kernels.machine import this_machine
from linkwork.kernels.program import Program
from linkwork.patience import announced

_OPERATIONS = struct.Struct("<q")


@dataclass(frozen=True)
class Module:
    """Loaded machine code.

    addresses: of its functions, by name, which hold as long as this object lives
    operations: of the program
    from_cache: whether the code was found in the cache; seconds: the time it took to get it
    """

    code: Code
    operations: int
    from_cache: bool
    seconds: float

    @property
    def addresses(self) -> dict[str, int]:
        return self.code.addresses


def load(f: ca.Function, program: Callable[[], Program], kind: Kind) -> Module:
    """Return the code of a function, of one kind.

    program: makes the function's program, which is needed where the code is not in the cache.
    """
    start = time.perf_counter()

    def compiled() -> bytes:
        machine = this_machine()
        with announced(f"compiling {f.name()}"), uncollected():
            own = program()
            code = object_code(source_text(own, machine, kind), machine)
        return _OPERATIONS.pack(own.operations) + code

    content, from_cache = cache.kept(entry_of(f.serialize(), kind), compiled)
    return loaded(content, kind, start, from_cache)


def entry_of(told: str, kind: str) -> str:
    """Return the name of a function's entry in the cache; told: as CasADi writes it."""
    return cache.key(told, this_machine().identity, kind)


def loaded(content: bytes, kind: Kind, start: float, from_cache: bool = True) -> Module:
    """Return the code of an entry."""
    (operations,) = _OPERATIONS.unpack_from(content)
    code = Code(content[_OPERATIONS.size :], FUNCTIONS.get(kind, (kind,)))
    return Module(code, operations, from_cache, time.perf_counter() - start)


@contextmanager
def uncollected() -> Iterator[None]:
    """Keep Python from looking for cycles: what is compiled is many small objects, nearly all in
    use, which it would go through again and again."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
