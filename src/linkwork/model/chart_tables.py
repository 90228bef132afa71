"""Charts as tables: a large mechanism's charts that runs come upon, evaluated without code of their
own.

What depends on no chart is compiled once (`equations.uncharted`); a table names the independent
rates and the order of elimination to the code that all charts of all mechanisms share
(`simulation.partitioned`). Results are those of a chart's own kernels but for rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.equations import Equations, uncharted
from linkwork.equations.chart import Chart
from linkwork.kernels import Kernel
from linkwork.kernels.bound import BoundFunction

if TYPE_CHECKING:
    from linkwork.simulation.partitioned import TableSizes

Compiled = Callable[[str, Callable[[Equations], ca.Function]], Kernel]

BESIDE = {
    "motion": uncharted.forces,
    "closure_step": uncharted.moved,
    "tree_motion": uncharted.bias,
}  # what entries need beside Phi, by name


def tabled(
    compiled: Compiled,
    equations: Equations,
    name: str,
    acting: Kernel | None = None,
    wide: bool = False,
) -> BoundFunction:
    """Return motion, closure_step, tree_rates, tree_motion or what is seen of equations in a
    chart.

    compiled: returns the kernel of a function of these equations, under a key for all charts
    acting: of (q, w, z, r, p), in place of plain forces: `Joined.balance` of motion, or what is
        seen
    wide: for states side by side, as a kernel's `wide_address`, in place of one state
    """
    from linkwork.simulation import partitioned  # Numba is opened when a run needs it

    turned = name == "closure_step" and equations.tree.quaternions
    closure = uncharted.opening if turned else uncharted.closure
    kernels = [compiled(f"uncharted {closure.__name__}", closure)]
    if acting is not None:
        kernels.append(acting)
    elif name in BESIDE:
        kernels.append(compiled(f"uncharted {name}", BESIDE[name]))
    found = [kernel.wide_address if wide else kernel.early_address for kernel in kernels]
    table = table_of(equations, acting, found)
    told = sizes(equations, acting)
    nq, nv, n, parameters = told.nq, told.nv, told.n, told.parameters
    given = nq + n + told.inputs + parameters + told.own
    shapes = {
        "motion": (given, nq + n + told.states + 1),
        "closure_step": (nq + parameters, nq + 1),
        "tree_rates": (nq + n + parameters, nv + 1),
        "tree_motion": (nq + 2 * n + parameters, 2 * nv),
        "seen": (given, kernels[-1].n_out),
    }
    return BoundFunction(partitioned.entry(name, wide), table, *shapes[name], *kernels)


def jacobian(
    compiled: Compiled, equations: Equations, balance: Kernel, slopes: Kernel
) -> BoundFunction:
    """Return df/dy and df/dr of equations in a chart with what acts, for one state.

    balance, slopes: those of `Joined`, in the rates of the whole tree
    """
    from linkwork.simulation import partitioned_slopes

    kernels = [
        compiled("uncharted closure", uncharted.closure),
        balance,
        compiled("uncharted turning", uncharted.turning),
        slopes,
    ]
    *alone, abreast = kernels
    addresses = [*(kernel.address for kernel in alone), abreast.wide_address]
    told = sizes(equations, balance)
    nq, n, inputs = told.nq, told.n, told.inputs
    shape = nq + n + inputs + told.parameters + told.own, (nq + n + told.states) * (nq + n + inputs)
    table = table_of(equations, balance, addresses)
    return BoundFunction(partitioned_slopes.entry(), table, *shape, *kernels)


def table_of(equations: Equations, acting: Kernel | None, addresses: Sequence[int]) -> np.ndarray:
    """Return the numbers of a table (`simulation.partitioned`)."""
    from linkwork.simulation import partitioned

    places = [*addresses, *[0] * partitioned.ADDRESSES][: partitioned.ADDRESSES]
    order = elimination(equations.chart, equations.rows.pattern)
    return np.array([*sizes(equations, acting), *places, *order], float)


def sizes(equations: Equations, acting: Kernel | None = None) -> TableSizes:
    """Return the sizes of equations in a chart, with what acts."""
    from linkwork.simulation.partitioned import TableSizes

    parameters, states, own = equations.p.numel(), 0, 0
    inputs = len(equations.mechanism.actuators)
    if acting is not None:
        given = [size for _, size in acting.inputs]
        states, own = given[2], given[4] - parameters
        inputs = states + given[3]
    return TableSizes(
        nq=equations.nq,
        nv=equations.nv,
        n=equations.mobility,
        d=len(equations.chart.dependent),
        rows=len(equations.rows.names),
        inputs=inputs,
        parameters=parameters,
        blocks=len(equations.chart.blocks),
        states=states,
        own=own,
    )


def elimination(chart: Chart, pattern: Mapping[int, Mapping[int, bool]]) -> list[float]:
    """Return the chart's rates and rows, and each block's size, scale and whether it varies."""
    order = list(
        zip(chart.blocks, [s for stage in chart.stages for s in stage.scales], strict=True)
    )
    columns = [c for block, _ in order for c in block.columns]
    kept = [r for block, _ in order for r in block.rows]
    vary = varying(chart, pattern)
    blocks = [
        number
        for (block, scale), varies in zip(order, vary, strict=True)
        for number in (len(block.rows), scale, varies)
    ]
    return [*chart.independent, *columns, *kept, *blocks]


def varying(chart: Chart, pattern: Mapping[int, Mapping[int, bool]]) -> list[bool]:
    """Tell of each block of the elimination whether its determinant depends on the configuration.

    pattern: the elements of Phi that are not zero, and whether they are constant
    """
    found = []
    for stage in chart.stages:
        own = set(stage.columns)
        constant = {r: {c: x for c, x in pattern[r].items() if c in own} for r in stage.rows}
        for block in stage.blocks:
            taken = {r: constant.pop(r) for r in block.rows}
            found.append(
                not all(x for row in taken.values() for c, x in row.items() if c in block.columns)
            )
            for row in constant.values():
                if any(row.pop(c, None) is not None for c in block.columns):
                    row |= {
                        c: False for old in taken.values() for c in old if c not in block.columns
                    }
    return found
