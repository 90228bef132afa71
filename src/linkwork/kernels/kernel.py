"""A compiled function: what a caller holds."""

import ctypes
import threading
from collections.abc import Callable, Iterable
from functools import cached_property
from itertools import accumulate
from math import prod

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.kernels.emit import ABREAST, Kind
from linkwork.kernels.from_python import SHORT, all_outputs, left_to_others
from linkwork.kernels.interpreter import LONG, PAYS, Interpreted, found_or_told
from linkwork.kernels.listing import kept_count, listing
from linkwork.kernels.machine import this_machine
from linkwork.kernels.module import Module, load
from linkwork.kernels.program import KernelError, Program, refuse_unknown, signature, trace
from linkwork.kernels.simplify import simplify
from linkwork.threads import crew

_ONE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
_ROWS = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 5)
_ALIGNMENT = 64
FEWEST = 2000  # states that are worth a thread
SCATTERED = 10_000  # states, one by one, that take as long as compiling code for many
WORTH = 5_000  # evaluations of one state, asked for one by one, that are worth compiling for


def compile_function(
    f: ca.Function,
    rows: Callable[[], ca.Function] | None = None,
    patient: Callable[[], bool] | None = None,
) -> "Kernel":
    """Return the kernel of a CasADi function of SX: machine code, compiled or taken from the cache
    when it is first needed.

    Inputs and outputs of any number and shape, dense or sparse, become flat vectors: each dense and
    column-major, one after the other. Every operation of SX graphs is compiled but for `erfinv`,
    `printme` and calls of functions that are not inlined. The code for one state, for blocks of
    states and for states side by side is separate: a process that needs one kind does not wait for
    the others.

    f: the function; it has no free variables. rows: gives the gradient of weights times the value
    that f is the Jacobian of, if code for one state is to be made of that (`unit_rows`). patient:
    tells, if f is LONG, whether one state may be interpreted until code is worth compiling.
    Returns the kernel.  Raises KernelError naming what cannot be compiled.
    The kernel warns once where the cache's folder cannot be written, and where an entry of the
    cache is damaged; it is right all the same.
    """
    kernel = Kernel(f, rows, patient)
    refuse_unknown(f)
    return kernel


class Kernel:
    """A function compiled to machine code, for one state and for many at a time.

    Calls interpret it, to the same bits, until so many states were asked for that compiling pays.

    name: the function's
    inputs, outputs: (name, number of doubles) of each argument and result, in order
    n_in, n_out: number of doubles of all inputs and of all outputs
    operations: number of arithmetic operations of one evaluation, each +, -, *, /, sqrt, sin, ...
        counting one
    lanes: states in one vector register
    abreast: vector registers of states that the code for a loop evaluates together
    address: of void(const double* in, double* out), which evaluates one state
    early_address: of the same, to the same bits, where the kernel is patient: an interpreter until
        there is code (`settle`)
    batch_address: of void(int64_t blocks, const double* in, double* out), which evaluates blocks of
        `lanes` states, laid out `in[block][n_in][lanes]` and `out[block][n_out][lanes]` and aligned
        to 64 bytes
    rows_address: of the function that evaluates states stored one a row (`stored_states`)
    dense_address: of void(int64_t blocks, const double** in, double** out), which evaluates blocks
        of `lanes` states stored one a row, without gaps (`dense`)
    wide_address: of void(const double* in, double* out), which evaluates `abreast` x `lanes`
        states, laid out `in[n_in][abreast * lanes]` and `out[n_out][abreast * lanes]` and aligned
        to 64 bytes: for loops whose next states need the results of these
    columns_address: of void(const double* in, double* out), which evaluates one state without its
        last input at each unit vector of that, `out[direction][n_out]`: a Jacobian, where the last
        input is the direction of a derivative
    from_cache: whether all machine code so far was found in the cache
    compile_seconds: the time it took to get it [s]

    `in` and `out` may not overlap. The functions hold no state and may be called by any number of
    threads at a time; they are valid as long as the kernel lives.
    """

    def __init__(
        self,
        f: ca.Function,
        rows: Callable[[], ca.Function] | None = None,
        patient: Callable[[], bool] | None = None,
    ):
        self.inputs, self.outputs = signature(f)
        self._function, self._by_rows = f, rows
        self.name: str = f.name()
        self.n_in = sum(size for _, size in self.inputs)
        self.n_out = sum(size for _, size in self.outputs)
        self.lanes = this_machine().lanes
        self.abreast = ABREAST
        self._modules: dict[Kind, Module] = {}
        self._tapes: list[Interpreted] = []
        long = rows is None and f.n_instructions() >= LONG
        self._patient = patient if long and patient else lambda: False
        self._lock = threading.Lock()
        self._buffers = _Buffers(self.inputs, self.outputs, self.lanes)
        self._shapes = tuple((size,) for _, size in self.inputs)
        self._last: NDArray[np.float64] | None = None
        self._scattered = 0
        self._straight = self._straight_flat = left_to_others

    def given(self, last: ArrayLike) -> "Kernel":
        """Return this kernel, with values for its last input that calls take where they leave it
        out.

        last: of shape (..., size).
        """
        kernel = object.__new__(type(self))
        kernel.__dict__ |= self.__dict__ | {"_last": np.asarray(last, dtype=np.float64)}
        kernel.__dict__.pop("_one", None)
        return kernel

    def __repr__(self) -> str:
        names = [
            ", ".join(f"{name}[{size}]" for name, size in part)
            for part in (self.inputs, self.outputs)
        ]
        return f"Kernel {self.name}: ({names[0]}) -> ({names[1]}), {self.operations} operations"

    def __reduce__(self):
        return _restored, (self._function, self._rows, self._last)

    @cached_property
    def address(self) -> int:
        (address,) = self._module("one").addresses.values()
        return address

    @cached_property
    def early_address(self) -> int:
        told = self._told() if self._patient() else None
        return told.address if told else self.address

    @cached_property
    def batch_address(self) -> int:
        return self._module("batch").addresses["batch"]

    @cached_property
    def rows_address(self) -> int:
        return self._module("batch").addresses["rows"]

    @cached_property
    def dense_address(self) -> int:
        return self._module("dense").addresses["dense"]

    @cached_property
    def wide_address(self) -> int:
        return self._module("wide").addresses["wide"]

    @cached_property
    def columns_address(self) -> int:
        return self._module("columns").addresses["columns"]

    @property
    def has_code(self) -> bool:
        """Whether there is machine code for one state."""
        return "one" in self._modules

    @property
    def operations(self) -> int:
        if not self._modules and (told := self._told()):
            return told.operations
        return self._any_modules()[0].operations

    @property
    def from_cache(self) -> bool:
        return all(module.from_cache for module in self._any_modules())

    @property
    def compile_seconds(self) -> float:
        return sum(module.seconds for module in self._any_modules())

    def __call__(self, *arrays: ArrayLike, threads: int = 1) -> tuple[NDArray[np.float64], ...]:
        """Evaluate one state or a batch of them.

        arrays: one for each input, of shape (..., size); the leading dimensions are broadcast
        against each other. threads: over which a large batch is dealt. Returns one array for each
        output, of shape (..., size).  Raises KernelError where a number or a shape does not fit.
        """
        if self._last is not None and len(arrays) == len(self.inputs) - 1:
            arrays = (*arrays, self._last)
        if (found := self._straight(*arrays)) is not None:
            return found
        if len(arrays) != len(self.inputs):
            raise KernelError(
                f"Kernel '{self.name}' takes {len(self.inputs)} arrays ({self._names()}), not "
                f"{len(arrays)}."
            )
        (_, x_address, x_parts), (_, y_address, y_parts) = self._buffers.one
        for part, array, shape in zip(x_parts, arrays, self._shapes, strict=True):
            array = np.asarray(array, dtype=np.float64)
            if array.shape != shape:
                return self._evaluate_rows(arrays, threads)
            part[...] = array
        self._one(x_address, y_address)
        return tuple([part.copy() for part in y_parts])

    def flat(self, *parts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate one state; return all outputs as one vector (n_out,).

        parts: vectors that are, one after the other, all inputs (n_in,).  Raises KernelError where
        their length does not fit.
        """
        if (found := self._straight_flat(*parts)) is not None:
            return found
        _, (y, y_address, _) = self._buffers.one
        x = _joined(parts)
        if len(x) != 8 * self.n_in:
            shapes = " and ".join(str(part.shape) for part in parts)
            raise KernelError(
                f"Kernel '{self.name}' takes {self.n_in} numbers, not parts of {shapes}."
            )
        self._one(x, y_address)
        return y.copy()

    def assembly(self, kind: Kind) -> str:
        """Return the assembly of the function for one state, for blocks of states, or for states
        side by side.

        kind: "one", "batch", "wide" ...: how many states a call evaluates.
        """
        _, program, made = self._source(kind)
        return listing(program(), this_machine(), made)

    def instruction_count(self, kind: Kind) -> int:
        """Return the number of machine instructions of the function of that kind."""
        return kept_count(*self._source(kind))

    def traced(self) -> Program:
        """Return the function as a straight-line program."""
        return trace(self._function)

    @cached_property
    def _program(self) -> Program:
        return simplify(self.traced())

    @cached_property
    def _one(self) -> Callable[[int | bytes, int], None]:
        """Evaluate one state: interpreted, until code is there or worth compiling."""
        told = self._told()
        if told is None or "one" in self._modules:
            self._go_straight()
            return _ONE(self.address)
        call, left = _ONE(told.address), WORTH

        def counted(x: int | bytes, y: int) -> None:
            nonlocal left
            call(x, y)
            left -= 1
            if left <= 0 or "one" in self._modules:
                self._module("one")
                self.__dict__.pop("_one", None)

        return counted

    def _go_straight(self) -> None:
        """Have calls of one state go straight into the code from now on, if it is short."""
        if (module := self._module("one")).operations <= SHORT:
            sizes, rows = [size for _, size in self.inputs], tuple((n,) for _, n in self.outputs)
            self._straight = all_outputs(self.address, sizes, rows, module)
            self._straight_flat = all_outputs(self.address, sizes, (self.n_out,), module)

    def _told(self) -> Interpreted | None:
        """Return the tape of this function, but where its code was found or is made of another."""
        with self._lock:
            if not (self._tapes or self._modules.get("one") or self._by_rows):
                given = self._function, lambda: self._program, self.n_in, self.n_out
                found = found_or_told(*given)
                if isinstance(found, Module):
                    self._modules["one"] = found
                else:
                    self._tapes.append(found)
            return self._tapes[0] if self._tapes else None

    @cached_property
    def _stored(self) -> Callable[..., None]:
        return _ROWS(self.rows_address)

    def settle(self, evaluations: int = PAYS) -> None:
        """Compile what was interpreted, if it was evaluated so often; whoever has its
        `early_address` calls the code from then on.

        evaluations: from how many on.
        """
        if self._tapes and self._tapes[0].evaluations >= evaluations:
            self._module("one")

    def _module(self, kind: Kind) -> Module:
        """Return the code of one kind; the first to ask waits for it."""
        with self._lock:
            if kind not in self._modules:
                self._modules[kind] = load(*self._source(kind))
                if kind == "one" and self._tapes:
                    self._tapes[0].become(self._modules[kind].addresses[kind])
            return self._modules[kind]

    def _source(self, kind: Kind) -> tuple[ca.Function, Callable[[], Program], Kind]:
        """Return the function and the program that code of a kind is made of, and how."""
        rows = self._rows if kind == "one" else None
        if rows is None:
            return self._function, lambda: self._program, kind
        return rows, lambda: simplify(trace(rows)), "by_rows"

    @cached_property
    def _rows(self) -> ca.Function | None:
        """The gradient that code for one state is made of, if it is."""
        return self._by_rows() if self._by_rows else None

    def _any_modules(self) -> list[Module]:
        """Return the code that there is, or that for one state where there is none."""
        return list(self._modules.values()) or [self._module("one")]

    def _names(self) -> str:
        return ", ".join(name for name, _ in self.inputs)

    def _evaluate_rows(
        self, arrays: tuple[ArrayLike, ...], threads: int
    ) -> tuple[NDArray[np.float64], ...]:
        values = [np.asarray(array, dtype=np.float64) for array in arrays]
        leading = self._leading_shape(values)
        rows = [_contiguous_rows(value, leading) for value in values]
        strides = [0 if row.ndim == 1 else row.shape[-1] for row in rows]
        sizes, count = [size for _, size in self.outputs], prod(leading)
        if self._is_scattered(count):
            return self._evaluate_each(rows, leading, count)
        results = tuple([np.empty((*leading, size)) for size in sizes])

        def evaluate(first: int, count: int) -> None:
            """Evaluate some of the states, by buffers of the thread that does so."""
            self._stored(
                count,
                _addresses(rows, strides, first),
                (ctypes.c_int64 * len(rows))(*strides),
                _addresses(results, sizes, first),
                *self._buffers.block_addresses,
            )

        parts = min(threads, count // FEWEST)
        if parts < 2:
            evaluate(0, count)
            return results
        share = -(-count // (parts * self.lanes)) * self.lanes
        with crew(parts) as pool:
            list(pool.map(lambda at: evaluate(at, min(share, count - at)), range(0, count, share)))
        return results

    def _is_scattered(self, count: int) -> bool:
        """Tell whether so few states were asked for so far that code for many is not worth
        compiling: that for one has the same bits, but where it is made of another function."""
        if "batch" in self._modules or self._by_rows or self._scattered + count > SCATTERED:
            return False
        self._scattered += count
        return True

    def _evaluate_each(
        self, rows: list[NDArray[np.float64]], leading: tuple[int, ...], count: int
    ) -> tuple[NDArray[np.float64], ...]:
        """Evaluate states one by one."""
        x, y = np.empty((count, self.n_in)), np.empty((count, self.n_out))
        for part, row in zip(_parted(x, self.inputs), rows, strict=True):
            part[...] = row if row.ndim == 1 else row.reshape(part.shape)
        one, x_address, y_address = self._one, x.ctypes.data, y.ctypes.data
        for k in range(count):
            one(x_address + 8 * self.n_in * k, y_address + 8 * self.n_out * k)
        return tuple(
            [part.reshape(*leading, part.shape[-1]).copy() for part in _parted(y, self.outputs)]
        )

    def _leading_shape(self, values: list[NDArray[np.float64]]) -> tuple[int, ...]:
        """Return the shape of the batch, the broadcast of all dimensions but the last."""
        for value, (name, size) in zip(values, self.inputs, strict=True):
            if value.ndim == 0 or value.shape[-1] != size:
                raise KernelError(
                    f"Input '{name}' of kernel '{self.name}' has the shape {value.shape}; its "
                    f"last dimension has to be {size}."
                )
        leading = [value.shape[:-1] for value in values]
        different = set(leading) - {()}
        if len(different) == 1:
            return different.pop()
        try:
            return np.broadcast_shapes(*different)
        except ValueError:
            shapes = ", ".join(
                f"{name} {shape}" for (name, _), shape in zip(self.inputs, leading, strict=True)
            )
            raise KernelError(
                f"The batches of kernel '{self.name}' do not fit each other: {shapes}."
            ) from None


def _restored(f: ca.Function, rows: ca.Function | None, last: NDArray[np.float64] | None) -> Kernel:
    kernel = Kernel(f, None if rows is None else lambda: rows)
    return kernel if last is None else kernel.given(last)


class _Buffers(threading.local):
    """Room for one evaluation, each thread its own.

    one: input and output of one state, each as a flat vector, its address, and its parts.
    block_addresses: of the input and the output of one block of states.
    """

    def __init__(
        self, inputs: tuple[tuple[str, int], ...], outputs: tuple[tuple[str, int], ...], lanes: int
    ):
        self.one = _partitioned(inputs), _partitioned(outputs)
        self._block = [_aligned(lanes * flat.size) for flat, _, _ in self.one]
        self.block_addresses: list[int] = [flat.ctypes.data for flat in self._block]


def _partitioned(
    parts: tuple[tuple[str, int], ...],
) -> tuple[NDArray[np.float64], int, list[NDArray[np.float64]]]:
    flat = _aligned(sum(size for _, size in parts))
    return flat, flat.ctypes.data, _parted(flat, parts)


def _parted(
    flat: NDArray[np.float64], parts: tuple[tuple[str, int], ...]
) -> list[NDArray[np.float64]]:
    """Return the parts of flat vectors (..., n)."""
    ends = accumulate(size for _, size in parts)
    return [flat[..., end - size : end] for end, (_, size) in zip(ends, parts, strict=True)]


def _joined(parts: tuple[NDArray[np.float64], ...]) -> bytes:
    """Return the doubles of vectors, one after the other; nothing where one of them is no
    vector."""
    vectors = all(part.ndim == 1 for part in parts)
    return b"".join([np.asarray(part, np.float64).tobytes() for part in parts] if vectors else [])


def _aligned(size: int) -> NDArray[np.float64]:
    """Return an uninitialised vector that starts at a multiple of 64 bytes."""
    memory = np.empty(size + _ALIGNMENT // 8)
    start = -memory.ctypes.data % _ALIGNMENT // 8
    return memory[start : start + size]


def _contiguous_rows(value: NDArray[np.float64], leading: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the rows of an input for a batch, without gaps, or its only row where all states share
    it."""
    if value.ndim == 1 or value.shape[:-1] == leading:
        return np.ascontiguousarray(value)
    return np.ascontiguousarray(np.broadcast_to(value, (*leading, value.shape[-1])))


def _addresses(arrays: Iterable[np.ndarray], strides: Iterable[int], row: int) -> ctypes.Array:
    """Return the addresses of a row of arrays, by how many doubles their rows are apart."""
    pointers = [
        array.ctypes.data + 8 * row * stride for array, stride in zip(arrays, strides, strict=True)
    ]
    return (ctypes.c_void_p * len(pointers))(*pointers)
