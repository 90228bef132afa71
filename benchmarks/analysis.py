"""Analysis: all assembly modes of Dietmaier's platform, and a workspace map of a million poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

import linkwork as lw
from linkwork.analysis import Modes, assembly_modes, workspace
from linkwork.robots import prr3
from linkwork.threads import usable_processors

from benchmarks.table import Figure, Section
from benchmarks.timing import Contender, interleaved, summary
from tests.analysis.mechanisms import dietmaier
from tests.oracle.published import DIETMAIER_SQUARES

MODES_METHOD = """
    Newton's method from random starts, in the lanes of vector registers and over all threads, until
    each solution was found several times and none in the second half of the starts. Dietmaier's leg
    lengths give the platform 40 real postures, the most there can be. "Fresh": the first search in
    the process, deriving the platform and compiling included where the cache is empty.
    """
MAP_METHOD = """
    A grid over x, y and the platform's angle; every pose is solved on the working mode of home, and
    its conditioning computed. The map is an `xarray.Dataset` with actuator positions, determinants
    and conditioning; the time is that of `analysis.workspace`, called and returned, on all threads;
    the first call, which compiles, is not counted.
    """


def modes(seeds: Sequence[int] = (0, 1, 2)) -> Section:
    """Find the assembly modes from several sets of random starts."""
    joints = {
        f"leg_{i}": float(np.sqrt(square)) for i, square in enumerate(DIETMAIER_SQUARES, start=1)
    }
    first, _ = timed(lambda: assembly_modes(dietmaier(), joints, seed=seeds[0]))
    seconds, found = zip(
        *(
            timed(lambda seed=seed: assembly_modes(dietmaier(), joints, seed=seed))
            for seed in seeds
        ),
        strict=True,
    )
    counts = [len(one) for one in found]
    starts = "; ".join(
        f"{one.starts:,} starts, the rarest found {one.hits.min()} times" for one in found
    )
    figures = [
        Figure(
            "assembly modes found, the least of all searches",
            float(min(counts)),
            "",
            40,
            "at least",
            starts,
        ),
        Figure("assembly modes found, the most", float(max(counts)), "", 40),
        Figure(
            f"time of a search on {usable_processors()} cores, the longest", max(seconds), "s", 60.0
        ),
        Figure("the same, fresh", first, "s", 60.0),
    ]
    return Section(
        "Assembly modes of Dietmaier's platform",
        MODES_METHOD,
        figures,
        {"seconds": seconds, "counts": counts},
    )


def timed(search: Callable[[], Modes]) -> tuple[float, Modes]:
    """Return how long a search takes [s], and what it found."""
    start = perf_counter()
    found = search()
    return perf_counter() - start, found


def maps(along: int = 100, rounds: int = 3) -> Section:
    """Map the workspace of the 3-PRR over so many poses along each of three axes."""
    robot = lw.Robot(prr3())
    ends = {"x": (0.1, 0.9), "y": (0.0, 0.7), "angle": (0.9, 2.4)}
    grid = {name: np.linspace(*pair, along) for name, pair in ends.items()}
    mapped = workspace(robot, grid)
    seconds = interleaved({"map": Contender(lambda: workspace(robot, grid))}, rounds)["map"]
    reached = float(mapped.reachable.mean())
    figures = [
        Figure(f"map of {along**3:,} poses with conditioning", float(np.median(seconds)), "s", 2.0,
               note=f"best {seconds.min():.3g} s, {100 * reached:.0f} % within reach"),
        Figure("the same, per pose", 1e6 * float(np.median(seconds)) / along**3, "µs"),
    ]  # fmt: skip
    return Section(
        "Workspace map of the 3-PRR",
        MAP_METHOD,
        figures,
        {"seconds": summary(seconds), "reached": reached},
    )
