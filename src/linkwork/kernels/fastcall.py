"""The code of a call from Python: a function of CPython's own calling convention, made of LLVM
instructions, once for all kernels,

    PyObject *direct(PyObject *self, PyObject *const *args, Py_ssize_t count)

It looks whether each argument is a vector of doubles without gaps, or a list or a tuple of numbers,
copies them one behind the other, calls the kernel, and makes an array of its results, or a tuple of
arrays; None where it takes something not, or the results do not hold.

`self` is a table of words: what HEAD names, the sizes of the arguments, what RESULT names of each
array, and room for the inputs (after the arguments those that stay the same).

Source: Python/C API Reference, `METH_FASTCALL`, stable ABI; NumPy C-API, `PyArray_New`.
"""

import numpy as np

HEAD = (
    *("kernel", "apart", "arguments", "x", "y", "watch", "bound"),
    *("first", "looked", "together", "results"),
)
RESULT = "count", "dimensions", "rows", "columns", "order"  # of one array
DOUBLE = np.dtype(np.float64)
DOUBLES = int.from_bytes(b"fd=\0" + DOUBLE.num.to_bytes(4, "little"), "little")
TOLD = ~(0xFF << 24)  # a word of NumPy's types: kind, letter, order of bytes, (flags), number
PLAIN = 0x101  # NumPy's flags of an array without gaps, aligned
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
