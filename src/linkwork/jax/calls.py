"""Kernels as calls of XLA: handlers, compiled and registered when they are first asked for."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import jax
import jax.numpy as jnp

from linkwork.jax.dense_rows import chunk_text
from linkwork.jax.evaluation import block_text
from linkwork.jax.handler import Sentences, handler_text
from linkwork.kernels import Kernel
from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.machine import this_machine
from linkwork.model.checks import PIVOT_BOUND

HANDLER = "handler"
_numbers = count()


@dataclass(frozen=True, eq=False)
class Calls:
    """Make XLA's calls of one robot's kernels.

    robot: its name; independent: names of the rates; raises: whether a state for which a function
        is not defined is an error; else its results are NaN
    """

    robot: str
    independent: tuple[str, ...]
    raises: bool
    _made: dict[int, Callable[..., Any]] = field(default_factory=dict)

    def of(self, kernel: Kernel, weighed: bool) -> Callable[..., Any]:
        """Return the call of a kernel: arrays (..., size) -> its first output (..., m)."""
        if id(kernel) not in self._made:
            given = kernel, weighed, PIVOT_BOUND, this_machine()
            block = f"{block_text(*given)}\n\n{chunk_text(*given)}"
            sizes = [size for _, size in kernel.inputs]
            outputs, told = [kernel.outputs[0][1]], self.sentences(kernel.name)
            self._made[id(kernel)] = self.made(kernel.name, block, sizes, outputs, told, kernel)
        call = self._made[id(kernel)]
        return lambda *x: call(*x)[0]

    def made(
        self,
        name: str,
        block: str,
        inputs: list[int],
        outputs: list[int],
        told: Sentences,
        *kept: object,
    ) -> Callable[..., Any]:
        """Return the call of a function `block` (`handler`): arrays (..., size) with equal leading
        dimensions, or none, -> arrays (..., size).

        name: of what it evaluates; told: where it refuses; kept: what the machine code needs
        """
        machine = this_machine()
        text = handler_text(inputs, outputs, told, self.raises, machine, "@chunk" in block)
        code = Code(object_code(f"{block}\n\n{text}", machine), (HANDLER,))
        target = f"linkwork.{self.robot}.{name}.{next(_numbers)}"
        capsule = jax.ffi.pycapsule(ctypes.cast(code.addresses[HANDLER], ctypes.c_void_p))
        jax.ffi.register_ffi_target(target, capsule, platform="cpu")
        _held.append((code, *kept))

        def call(*x: Any) -> Any:
            lead = jnp.broadcast_shapes(*(each.shape[:-1] for each in x))
            found = [jax.ShapeDtypeStruct((*lead, size), jnp.float64) for size in outputs]
            return jax.ffi.ffi_call(target, found, vmap_method="broadcast_all")(*x)

        return call

    def sentences(self, name: str) -> Sentences:
        rates, begin = ", ".join(self.independent), f"{name} of {self.robot}"
        return Sentences(
            f"{begin} was called with arrays of other sizes than it was made for",
            f"{begin}: the rates {rates} do not determine the motion; take other independent rates "
            f"by linkwork.jax.model(robot, chart), or singular='nan'; {WHERE}",
            f"{begin}: the result is not finite, for numbers given are not or the configuration is "
            f"singular; give others, or take singular='nan'; {WHERE}",
        )


WHERE = "number of the state in the call, from 0: "
_held: list[tuple[object, ...]] = []
"""Machine code that XLA knows by its address: as long as the process, for a target stays registered
until then."""
