"""From Python straight into a kernel: one state, vectors as they are, in one call.

A call through ctypes takes as long as a small kernel, and each copy by NumPy most of that again.
Here a function of CPython's own calling convention is made of LLVM instructions, once for all
kernels,

    PyObject *direct(PyObject *self, PyObject *const *args, Py_ssize_t count)

which looks whether each argument is a vector of doubles without gaps, or a list or a tuple of
numbers, copies them one behind the other, calls the kernel, and makes an array of its results, or a
tuple of arrays. What it does not take, and results that are not finite or that the kernel doubts,
it leaves to others: None. It reads arrays as NumPy's binary interface has them; where Python or
NumPy have another one, the same is done by ctypes.

`self` is a table of words: what HEAD names, the sizes of the arguments, what RESULT names of each
array, and room for the inputs (after the arguments those that stay the same). Python lets one
thread at a time in, from the first argument to the array, so that a kernel is to be short; what
takes longer lets others run, and is called by one thread at a time (`Ends.apart`).

Source: Python/C API Reference, `METH_FASTCALL`, stable ABI; NumPy C-API, `PyArray_New`.
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
from linkwork.kernels.machine import this_machine

Direct = Callable[..., Any]  # an array, or a tuple of them, or None
DOUBLE, NDARRAY, NEW = np.dtype(np.float64), 2, 93  # of NumPy's C-API
DOUBLES = int.from_bytes(b"fd=\0" + DOUBLE.num.to_bytes(4, "little"), "little")
TOLD = ~(0xFF << 24)  # a word of NumPy's types: kind, letter, order of bytes, (flags), number
FASTCALL, ABI = 0x80, 2  # of Python's methods; NumPy's number of its binary interface
HEAD = (
    *("kernel", "apart", "arguments", "x", "y", "watch", "bound"),
    *("first", "looked", "together", "results"),
)
SHORT = 20_000  # operations, some 10 us, for which no other thread need be let in
RESULT = "count", "dimensions", "rows", "columns", "order"  # of one array
NONE = np.empty(0)
PLAIN = 0x101  # NumPy's flags of an array without gaps, aligned
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


PYTHON = (
    *("PySequence_Size", "PySequence_GetItem", "PyFloat_AsDouble"),
    *("PyErr_Occurred", "PyErr_Clear", "Py_IncRef", "Py_DecRef"),
    *("PyEval_SaveThread", "PyEval_RestoreThread", "PyTuple_New", "PyTuple_SetItem"),
)


def _word(name: str, of: str = "i64", names: tuple[str, ...] = HEAD, table: str = "table") -> str:
    """Return the lines that read a word of a table by its name."""
    return (
        f"  %{name}.at = getelementptr i64, ptr %{table}, i64 {names.index(name)}\n"
        f"  %{name} = load {of}, ptr %{name}.at\n"
    )


TEXT = f"""
@ndarray = external global i8
@list = external global i8
@tuple = external global i8
@float = external global i8
@int = external global i8
@none = external global i8
declare ptr @PyArray_New(ptr, i32, ptr, i32, ptr, ptr, i32, i32, ptr)
declare i64 @PySequence_Size(ptr)
declare ptr @PySequence_GetItem(ptr, i64)
declare double @PyFloat_AsDouble(ptr)
declare ptr @PyErr_Occurred()
declare void @PyErr_Clear()
declare ptr @PyEval_SaveThread()
declare void @PyEval_RestoreThread(ptr)
declare void @Py_IncRef(ptr)
declare void @Py_DecRef(ptr)
declare ptr @PyTuple_New(i64)
declare i32 @PyTuple_SetItem(ptr, i64, ptr)
declare ptr @memcpy(ptr, ptr, i64)
declare double @llvm.fabs.f64(double)

define ptr @direct(ptr %self, ptr %args, i64 %given) {{
entry:
  %table.at = getelementptr i8, ptr %self, i64 16
  %table = load ptr, ptr %table.at
{_word("arguments")}{_word("x", "ptr")}{_word("y", "ptr")}
  %sizes = getelementptr i64, ptr %table, i64 {len(HEAD)}
  %fits = icmp eq i64 %given, %arguments
  br i1 %fits, label %begin, label %none

; A tuple for several arrays comes before all else: as it is made, what Python collects may call the
; same function.
begin:
{_word("together")}
  %is.alone = icmp eq i64 %together, 0
  br i1 %is.alone, label %start, label %gather
gather:
  %tuple = call ptr @PyTuple_New(i64 %together)
  %is.room = icmp ne ptr %tuple, null
  br i1 %is.room, label %start, label %out
start:
  %held = phi ptr [ null, %begin ], [ %tuple, %gather ]
  br label %next

; Argument by argument: its numbers behind those of the one before.
next:
  %k = phi i64 [ 0, %start ], [ %k.next, %taken ]
  %to = phi ptr [ %x, %start ], [ %to.next, %taken ]
  %all = icmp eq i64 %k, %arguments
  br i1 %all, label %evaluate, label %argument
argument:
  %object.at = getelementptr ptr, ptr %args, i64 %k
  %object = load ptr, ptr %object.at
  %size.at = getelementptr i64, ptr %sizes, i64 %k
  %size = load i64, ptr %size.at
  %kind.at = getelementptr i8, ptr %object, i64 8
  %kind = load ptr, ptr %kind.at
  %is.array = icmp eq ptr %kind, @ndarray
  br i1 %is.array, label %array, label %other

; An array: one dimension, doubles, without gaps, of the size that is asked for.
array:
  %nd.at = getelementptr i8, ptr %object, i64 24
  %nd = load i32, ptr %nd.at
  %descr.at = getelementptr i8, ptr %object, i64 56
  %descr = load ptr, ptr %descr.at
  %numbers.at = getelementptr i8, ptr %descr, i64 24
  %numbers = load i64, ptr %numbers.at
  %numbers.told = and i64 %numbers, {TOLD}
  %flags.at = getelementptr i8, ptr %object, i64 64
  %flags = load i32, ptr %flags.at
  %flags.told = and i32 %flags, {PLAIN}
  %is.plain = icmp eq i32 %flags.told, {PLAIN}
  %is.vector = icmp eq i32 %nd, 1
  %is.double = icmp eq i64 %numbers.told, {DOUBLES}
  %is.sound = and i1 %is.plain, %is.vector
  %is.taken = and i1 %is.sound, %is.double
  br i1 %is.taken, label %vector, label %refuse
vector:
  %shape.at = getelementptr i8, ptr %object, i64 32
  %shape = load ptr, ptr %shape.at
  %length = load i64, ptr %shape
  %is.long = icmp eq i64 %length, %size
  br i1 %is.long, label %copy, label %refuse
copy:
  %data.at = getelementptr i8, ptr %object, i64 16
  %data = load ptr, ptr %data.at
  %bytes = shl i64 %size, 3
  call ptr @memcpy(ptr %to, ptr %data, i64 %bytes)
  br label %taken

; A list or a tuple: so many floats or integers, all of them finite.
other:
  %is.list = icmp eq ptr %kind, @list
  %is.tuple = icmp eq ptr %kind, @tuple
  %is.sequence = or i1 %is.list, %is.tuple
  br i1 %is.sequence, label %sequence, label %refuse
sequence:
  %items = call i64 @PySequence_Size(ptr %object)
  %are.enough = icmp eq i64 %items, %size
  br i1 %are.enough, label %each, label %refuse
each:
  %j = phi i64 [ 0, %sequence ], [ %j.next, %store ]
  %are.all = icmp eq i64 %j, %size
  br i1 %are.all, label %taken, label %item
item:
  %one = call ptr @PySequence_GetItem(ptr %object, i64 %j)
  %is.none = icmp eq ptr %one, null
  br i1 %is.none, label %failed, label %typed
typed:
  %one.kind.at = getelementptr i8, ptr %one, i64 8
  %one.kind = load ptr, ptr %one.kind.at
  %is.float = icmp eq ptr %one.kind, @float
  %is.int = icmp eq ptr %one.kind, @int
  %is.number = or i1 %is.float, %is.int
  br i1 %is.number, label %number, label %drop
number:
  %value = call double @PyFloat_AsDouble(ptr %one)
  call void @Py_DecRef(ptr %one)
  %nothing = fsub double %value, %value
  %is.finite = fcmp oeq double %nothing, 0.0
  %may.fail = fcmp oeq double %value, -1.0
  br i1 %may.fail, label %look, label %fine
look:
  %error = call ptr @PyErr_Occurred()
  %is.well = icmp eq ptr %error, null
  br i1 %is.well, label %store, label %failed
fine:
  br i1 %is.finite, label %store, label %refuse
store:
  %value.at = getelementptr double, ptr %to, i64 %j
  store double %value, ptr %value.at
  %j.next = add i64 %j, 1
  br label %each
drop:
  call void @Py_DecRef(ptr %one)
  br label %refuse

taken:
  %to.next = getelementptr double, ptr %to, i64 %size
  %k.next = add i64 %k, 1
  br label %next

; The kernel, and whether its results hold.
evaluate:
{_word("kernel", "ptr")}{_word("watch", "ptr")}{_word("bound", "double")}
{_word("first", "ptr")}{_word("looked")}{_word("apart")}
  %is.apart = icmp ne i64 %apart, 0
  br i1 %is.apart, label %others.run, label %alone
others.run:
  %thread = call ptr @PyEval_SaveThread()
  call void %kernel(ptr %x, ptr %y)
  call void @PyEval_RestoreThread(ptr %thread)
  br label %called
alone:
  call void %kernel(ptr %x, ptr %y)
  br label %called
called:
  %told = load double, ptr %watch
  %told.size = call double @llvm.fabs.f64(double %told)
  %holds = fcmp ogt double %told.size, %bound
  br i1 %holds, label %look.through, label %refuse
look.through:
  %i = phi i64 [ 0, %called ], [ %i.next, %seen ]
  %sum = phi double [ 0.0, %called ], [ %sum.next, %seen ]
  %is.end = icmp eq i64 %i, %looked
  br i1 %is.end, label %judge, label %seen
seen:
  %result.at = getelementptr double, ptr %first, i64 %i
  %result = load double, ptr %result.at
  %zero = fmul double %result, 0.0
  %sum.next = fadd double %sum, %zero
  %i.next = add i64 %i, 1
  br label %look.through
judge:
  %are.finite = fcmp oeq double %sum, 0.0
  br i1 %are.finite, label %answer, label %refuse

; The results: an array, or a tuple of so many.
answer:
{_word("results", "ptr")}
  br label %make
make:
  %r = phi i64 [ 0, %answer ], [ %r.next, %more ]
  %asked = phi ptr [ %results, %answer ], [ %asked.next, %more ]
  %from = phi ptr [ %first, %answer ], [ %from.next, %more ]
{_word("count", "i64", RESULT, "asked")}{_word("dimensions", "i32", RESULT, "asked")}
{_word("order", "i32", RESULT, "asked")}
  %rows = getelementptr i64, ptr %asked, i64 {RESULT.index("rows")}
  %made = call ptr @PyArray_New(ptr @ndarray, i32 %dimensions, ptr %rows, i32 {DOUBLE.num},
    ptr null, ptr null, i32 0, i32 %order, ptr null)
  %is.made = icmp ne ptr %made, null
  br i1 %is.made, label %fill, label %unmade
fill:
  %room.at = getelementptr i8, ptr %made, i64 16
  %room = load ptr, ptr %room.at
  %results.bytes = shl i64 %count, 3
  call ptr @memcpy(ptr %room, ptr %from, i64 %results.bytes)
  br i1 %is.alone, label %done, label %more
more:
  %set = call i32 @PyTuple_SetItem(ptr %held, i64 %r, ptr %made)
  %r.next = add i64 %r, 1
  %asked.next = getelementptr i64, ptr %asked, i64 {len(RESULT)}
  %from.next = getelementptr double, ptr %from, i64 %count
  %is.complete = icmp eq i64 %r.next, %together
  br i1 %is.complete, label %done.together, label %make
done:
  ret ptr %made
done.together:
  ret ptr %held
unmade:
  br i1 %is.alone, label %out, label %let.go
let.go:
  call void @Py_DecRef(ptr %held)
  br label %out
out:
  ret ptr null

failed:
  call void @PyErr_Clear()
  br label %refuse
refuse:
  br i1 %is.alone, label %none, label %empty
empty:
  call void @Py_DecRef(ptr %held)
  br label %none
none:
  call void @Py_IncRef(ptr @none)
  ret ptr @none
}}
"""
