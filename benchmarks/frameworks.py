"""What a framework's call of the equations costs beside the machine code that it calls: JAX."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np

import linkwork as lw
import linkwork.jax
from linkwork.autodiff import functions_of

from benchmarks import native
from benchmarks.gradients import drawn
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved, summary

STACKS = 8_192, 32_768  # states; what a call costs XLA is small beside the larger
ROBOTS = ("prr3", "rrs3", "stewart")
MOST = 1.2  # times the bare vector kernel, promised
METHOD = """
    `jax.jit(jax.vmap(model.forward_dynamics))` on one core, for stacks of states beside home, with
    their rows read from and written to JAX's arrays, and each looked at for singular states and
    numbers that are not finite; beside the vector code of the same function over states that lie
    side by side already, the bare vector kernel, and the kernel's own call for stacks of rows. An
    empty call adds one to one number: what XLA takes for itself, whatever is called. With
    gradients: of |v'|^2 with respect to (q, v, u). Blocks of 2 ms or one call that take turns;
    times are those of the quickest blocks, and ratios of these.
    """


def run(rounds: int = 60, robots: Sequence[str] = ROBOTS) -> Section:
    """Time calls by XLA, and the kernels that they call, in turn."""
    jax.config.update("jax_enable_x64", True)
    figures, rows, raw = [], [], {}
    for name, count in product(robots, STACKS):
        seconds = interleaved(contenders(lw.Robot(name), count), rounds)
        quickest = {key: float(each.min()) for key, each in seconds.items()}
        bare, bound = quickest["bare vector kernel"], MOST if count == max(STACKS) else None
        for of, most in (("jit(vmap)", bound), ("stack of rows", None)):
            title = f"{name}, {count:,} states: {of}, times the bare vector kernel"
            figures.append(Figure(title, quickest[of] / bare, "", most))
        own = f"{name}, {count:,} states"
        rows += [(f"{own}: {key}", quantity(1e9 * each, "")) for key, each in quickest.items()]
        raw[own] = {key: summary(values) for key, values in seconds.items()}
    listing = Listing(("contender", "a state, or an empty call [ns]"), rows)
    return Section("JAX", METHOD, figures, {"seconds": raw}, listing=listing)


def contenders(robot: lw.Robot, count: int) -> dict[str, Contender]:
    """Return forward dynamics by XLA, with and without gradients, and its kernel."""
    model, kernel = linkwork.jax.model(robot), functions_of(robot)["forward_dynamics"].value
    states, forces = drawn(robot)
    repeated = count // len(forces)
    given = [np.tile(each, (repeated, 1)) for each in (states.q, states.rates, forces)]
    arrays, number = [jnp.asarray(each) for each in given], jnp.zeros(())
    empty = jax.jit(lambda x: x + 1)
    value = jax.jit(jax.vmap(model.forward_dynamics))
    slope = jax.jit(
        jax.vmap(jax.grad(lambda *x: jnp.sum(model.forward_dynamics(*x) ** 2), (0, 1, 2)))
    )
    return {
        "bare vector kernel": native.in_batches(kernel, np.hstack(given)),
        "stack of rows": Contender(lambda: kernel(*given), count),
        "jit(vmap)": Contender(lambda: jax.block_until_ready(value(*arrays)), count),
        "jit(vmap(grad))": Contender(lambda: jax.block_until_ready(slope(*arrays)), count),
        "an empty call": Contender(lambda: jax.block_until_ready(empty(number))),
    }
