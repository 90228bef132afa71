"""A function of inputs and outputs that is another one with a table: code for many, told by data.

void one(const double* in, double* out)        calls  void f(const double* in, double* out,
                                                             const double* table)

Where f and its table lie is read from a slot that is the function's own. Functions are compiled
many at a time, and those that nobody holds any more are given to others.
"""

from __future__ import annotations

import ctypes
import threading
import weakref
from functools import cached_property

import numpy as np

from linkwork.kernels.compile import Code, shared_code
from linkwork.kernels.machine import this_machine

MANY = 64
_ONE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


class BoundFunction:
    """Evaluate a compiled function of (in, out, table) with its table, as a kernel does for one
    state.

    f: its address; table: numbers, kept alive with this; n_in, n_out: numbers of the input and the
    output
    kept: what else has to live as long
    """

    def __init__(self, f: int, table: np.ndarray, n_in: int, n_out: int, *kept: object):
        self.n_in, self.n_out, self._f, self._table, self._kept = n_in, n_out, f, table, kept

    @cached_property
    def address(self) -> int:
        """Address of void(const double *in, double *out)."""
        address = _slots.taken(self._f, self._table.ctypes.data)
        weakref.finalize(self, _slots.leave, address)
        return address

    @cached_property
    def early_address(self) -> int:
        """The same, as of a kernel."""
        return self.address

    def become(self, f: int) -> None:
        """Have another function called from now on, whoever holds the address."""
        self._f = f
        _slots.lead(self.address, f)

    def flat(self, *parts: np.ndarray) -> np.ndarray:
        """Return the outputs (n_out,) of an input that is given in parts, one after the other."""
        x, y = np.concatenate(parts), np.empty(self.n_out)
        _ONE(self.address)(x.ctypes.data, y.ctypes.data)
        return y

    def rows(self, *parts: np.ndarray) -> np.ndarray:
        """Return the outputs (K, n_out) of K states, one by one; parts: (K, ...), or (1, ...) or
        (...) for all of them."""
        (count,) = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
        each = [np.broadcast_to(part, (count, part.shape[-1])) for part in parts]
        found = [self.flat(*state) for state in zip(*each, strict=True)]
        return np.array(found).reshape(count, self.n_out)


class _Slots:
    """Deal functions that are compiled MANY at a time, by their addresses."""

    def __init__(self):
        self._lock = threading.Lock()
        self._free: list[int] = []
        self._places: dict[int, int] = {}
        self._codes: list[Code] = []

    def taken(self, f: int, table: int) -> int:
        """Return the address of a free function that calls f with a table from now on."""
        with self._lock:
            if not self._free:
                self._compile()
            address = self._free.pop()
            (ctypes.c_int64 * 2).from_address(self._places[address])[:] = [f, table]
            return address

    def lead(self, address: int, f: int) -> None:
        """Have a function call f from now on."""
        ctypes.c_int64.from_address(self._places[address]).value = f

    def leave(self, address: int) -> None:
        """Take a function back that nobody calls any more."""
        self._free.append(address)

    def _compile(self) -> None:
        names = [f"one.{k}" for k in range(MANY)]
        code = shared_code(slots_text(), this_machine(), (*names, "slots"))
        self._codes.append(code)
        for k, name in enumerate(names):
            self._free.append(code.addresses[name])
            self._places[code.addresses[name]] = code.addresses["slots"] + 16 * k


def slots_text() -> str:
    """Return the LLVM module of MANY functions, and of the slots that they read."""
    parts = [f"@slots = global [{MANY} x [2 x i64]] zeroinitializer"]
    for k in range(MANY):
        place = f"getelementptr inbounds ([{MANY} x [2 x i64]], ptr @slots, i64 0, i64 {k}, i64"
        parts.append(
            f"define void @one.{k}(ptr %in, ptr %out) {{\n"
            f"  %f = load ptr, ptr {place} 0)\n"
            f"  %table = load ptr, ptr {place} 1)\n"
            "  call void %f(ptr %in, ptr %out, ptr %table)\n"
            "  ret void\n}"
        )
    return "\n\n".join(parts) + "\n"


_slots = _Slots()
