"""A function of inputs and outputs that is another one with a table: code for many, told by data.

void one(const double* in, double* out)        calls  void f(const double* in, double* out,
                                                             const double* table)
"""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.machine import this_machine

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
    def _code(self) -> Code:
        text = (
            "define void @one(ptr %in, ptr %out) {\n"
            f"  %f = inttoptr i64 {self._f} to ptr\n"
            f"  %table = inttoptr i64 {self._table.ctypes.data} to ptr\n"
            "  call void %f(ptr %in, ptr %out, ptr %table)\n"
            "  ret void\n}\n"
        )
        return Code(object_code(text, this_machine()), ("one",))

    @cached_property
    def address(self) -> int:
        """Address of void(const double *in, double *out)."""
        return self._code.addresses["one"]

    def flat(self, *parts: np.ndarray) -> np.ndarray:
        """Return the outputs (n_out,) of an input that is given in parts, one after the other."""
        x, y = np.concatenate(parts), np.empty(self.n_out)
        _ONE(self.address)(x.ctypes.data, y.ctypes.data)
        return y

    def rows(self, *parts: np.ndarray) -> np.ndarray:
        """Return the outputs (K, n_out) of K states, one by one; parts: (K, ...), or (...) for all
        of them."""
        count = max(len(part) for part in parts if part.ndim > 1)
        each = [np.broadcast_to(part, (count, part.shape[-1])) for part in parts]
        found = [self.flat(*state) for state in zip(*each, strict=True)]
        return np.array(found).reshape(count, self.n_out)
