"""From Python straight into a kernel: one state, vectors as they are, in one call.

A call through ctypes takes as long as a small kernel, and each copy by NumPy most of that again.
Here a function of CPython's own calling convention (`fastcall`) is made for each kernel. What it
does not take, and results that are not finite or that the kernel doubts, it leaves to others: None.
It reads arrays as NumPy's binary interface has them; where Python or NumPy have another one, the
same is done by ctypes.

Python lets one thread at a time in, from the first argument to the array, so that a kernel is to be
short; what takes longer lets others run, and is called by one thread at a time (`Ends.apart`).
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from itertools import accumulate
from math import isfinite, prod
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from linkwork.kernels.compile import Code, shared_code
from linkwork.kernels.fastcall import DOUBLE, DOUBLES, HEAD, PLAIN, PYTHON, RESULT, TEXT, TOLD
from linkwork.kernels.machine import this_machine

Direct = Callable[..., Any]  # an array, or a tuple of them, or None
NDARRAY, NEW = 2, 93  # of NumPy's C-API
FASTCALL, ABI = 0x80, 2  # of Python's methods; NumPy's number of its binary interface
SHORT = 20_000  # operations, some 10 us, for which no other thread need be let in
NONE = np.empty(0)
_ONE = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
Shape = tuple[int, ...]  # of at most two dimensions
Arrays = Shape | tuple[Shape, ...]  # one array, or a tuple of them, one behind the other in memory


class Addressed(Protocol):
    """A kernel: where its code for one state is, and how many numbers that gives."""

    n_out: int

    @cached_property
    def address(self) -> int:
        """Return the address of void(const double *in, double *out)."""
        ...


class Columns(tuple[int, ...]):
    """A shape of a matrix that lies in memory column by column."""


class AskedOutputs(NamedTuple):
    """Say which of a kernel's outputs are asked for: those from `first` on, in this shape, or these
    shapes; the last output is larger than `bound`, in size, where they hold."""

    first: int
    shape: Arrays
    bound: float


class Ends(NamedTuple):
    """Say where a function of (in, out) leaves what it finds.

    out: what it is called with; first, shape: where its results begin, and their shape; watch:
    where the number is that is larger than `bound`, in size, where they hold; finite: whether they
    hold only then; apart: whether other threads run while it does, and only one calls it at a time
    """

    out: int
    first: int
    shape: Arrays
    watch: int
    bound: float
    finite: bool = True
    apart: bool = False


def direct(
    kernel: Addressed, sizes: Sequence[int], constants: np.ndarray, results: AskedOutputs
) -> Direct:
    """Return a function of vectors (size), which are, with the constants after them, the kernel's
    inputs; it returns new arrays, or None where it does not take them or doubts the results.

    It compiles the kernel, and keeps it alive.
    """
    y = np.empty(kernel.n_out)
    out, (first, shape, bound) = y.ctypes.data, results
    ends = Ends(out, out + 8 * first, shape, out + 8 * (kernel.n_out - 1), bound)
    call = call_of(kernel.address, sizes, constants, ends, kernel, y)
    return call or _by_ctypes(kernel, sizes, constants, results)


def call_of(
    f: int, sizes: Sequence[int], constants: np.ndarray, ends: Ends, *kept: object
) -> Direct | None:
    """Return a function of vectors (size) that calls the one at an address, (in, out); None where
    Python or NumPy are others than this is written for.

    constants: behind the vectors; kept: what lives as long
    """
    interface = _interface()
    if interface is None:
        return None
    # The words of the call, and room for what the function takes.
    shapes, together = shapes_of(ends.shape)
    results = [
        (prod(each), len(each), *(*each, 0, 0)[:2], isinstance(each, Columns)) for each in shapes
    ]
    told, n = len(HEAD) + len(sizes), sum(sizes)
    start = told + len(RESULT) * len(results)
    table = np.zeros(start + n + constants.size, np.int64).view(Table)
    table.kept = interface, *kept
    numbers, at = table.view(np.float64), table.ctypes.data
    numbers[start + n :] = constants
    words = f, ends.apart, len(sizes), at + 8 * start, ends.out, ends.watch, 0
    looked = ends.finite * sum(count for count, *_ in results)
    table[:told] = (*words, ends.first, looked, together * len(shapes), at + 8 * told, *sizes)
    table[told:start] = [word for result in results for word in result]
    numbers[HEAD.index("bound")] = ends.bound
    return interface.make(ctypes.addressof(interface.method), table, None)


def all_outputs(f: int, sizes: Sequence[int], shape: Arrays, *kept: object) -> Direct:
    """Return a function of vectors (size) that calls the one at an address; it returns all outputs,
    in new arrays, or None where it does not take the vectors, or the last output is no number.

    kept: what lives as long
    """
    y = np.empty(sum(map(prod, shapes_of(shape)[0])))
    out = y.ctypes.data
    ends = Ends(out, out, shape, out + 8 * (y.size - 1), -1.0, finite=False)
    return (y.size and call_of(f, sizes, NONE, ends, y, *kept)) or left_to_others


def shapes_of(shape: Arrays) -> tuple[tuple[Shape, ...], bool]:
    """Return the shapes of all arrays, and whether they are to be in a tuple."""
    together = bool(shape) and isinstance(shape[0], tuple)
    return (shape if together else (shape,)), together  # pyright: ignore[reportReturnType]


def left_to_others(*_: object) -> None:
    """Take nothing: others do it."""


class Table(np.ndarray):
    """Words that tell a call what to do, and whose memory it uses.

    kept: what they name, which lives as long
    """

    kept: tuple[object, ...]


class _Interface(NamedTuple):
    """Hold what makes calls of Python: code, its definition as a method, and CPython's own
    maker."""

    code: Code
    method: ctypes.Structure
    make: Callable[..., Direct]


class _Method(ctypes.Structure):
    """CPython's PyMethodDef."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


@cache
def _interface() -> _Interface | None:
    """Return what makes calls of Python, or None where Python or NumPy are others than those that
    it is written for."""
    if sys.implementation.name != "cpython" or object.__basicsize__ != 16:
        return None  # other objects: other Pythons, those without the lock, 32 bits
    new = _numpy_new()
    if new is None or not _reads(np.zeros((2, 3))[:, 1:]) or not _reads(np.zeros(4)):
        return None
    objects = {"ndarray": np.ndarray, "none": None}
    objects |= {kind.__name__: kind for kind in (list, tuple, float, int)}
    addresses = {name: id(value) for name, value in objects.items()} | {"PyArray_New": new}
    for name in PYTHON:
        addresses[name] = ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0
    code = shared_code(TEXT, this_machine(), ("direct",), **addresses)
    method = _Method(b"direct", code.addresses["direct"], FASTCALL, None)
    maker = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    return _Interface(code, method, maker(("PyCFunction_NewEx", ctypes.pythonapi)))


def _numpy_new() -> int | None:
    """Return where `PyArray_New` is, if NumPy's binary interface is the one that is known."""
    try:
        from numpy._core._multiarray_umath import _ARRAY_API  # pyright: ignore
    except ImportError:
        return None
    pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)
    address = pointer(("PyCapsule_GetPointer", ctypes.pythonapi))(_ARRAY_API, None)
    api = (ctypes.c_void_p * (NEW + 1)).from_address(address)
    version = ctypes.CFUNCTYPE(ctypes.c_uint)(api[0] or 0)() >> 24
    return api[NEW] if version == ABI and api[NDARRAY] == id(np.ndarray) else None


def _reads(array: np.ndarray) -> bool:
    """Tell whether an array lies in memory as the code reads it."""
    if np.ndarray.__basicsize__ < 72:
        return False
    words = (ctypes.c_int64 * 9).from_address(id(array))
    told = words[1], words[2], words[3] & 0xFFFFFFFF, words[7]
    shape = (ctypes.c_int64 * array.ndim).from_address(words[4])
    if told != (id(np.ndarray), array.ctypes.data, array.ndim, id(array.dtype)):
        return False
    numbers = ctypes.c_int64.from_address(words[7] + 24).value
    if (numbers & TOLD == DOUBLES) != (array.dtype == DOUBLE):
        return False
    plain = array.flags.c_contiguous and array.flags.aligned
    return tuple(shape) == array.shape and (words[8] & PLAIN == PLAIN) == plain


def _by_ctypes(
    kernel: Addressed, sizes: Sequence[int], constants: np.ndarray, results: AskedOutputs
) -> Direct:
    """Return the same call in Python's own words."""
    call, (first, shape, bound) = _ONE(kernel.address), results
    shapes, together = shapes_of(shape)
    ends = [*accumulate(map(prod, shapes), initial=first)]
    orders: list[Literal["F", "C"]] = ["F" if isinstance(each, Columns) else "C" for each in shapes]

    def evaluated(*arrays: object) -> Any:
        if len(arrays) != len(sizes):
            return None
        for array, size in zip(arrays, sizes, strict=True):
            if not (type(array) is np.ndarray and array.dtype == DOUBLE and array.shape == (size,)):
                return None
            if not (array.flags.c_contiguous and array.flags.aligned):
                return None
        y = np.empty(kernel.n_out)
        taken = b"".join([array.tobytes() for array in (*arrays, constants)])  # pyright: ignore
        call(taken, y.ctypes.data)
        if not (abs(y.item(-1)) > bound and isfinite(sum(y[first : ends[-1]].tolist()))):
            return None
        parts = zip(shapes, orders, ends, ends[1:], strict=False)
        found = [y[at:end].reshape(each, order=o).copy(o) for each, o, at, end in parts]
        return tuple(found) if together else found[0]

    return evaluated
