"""The hostile cases: which start, task and method each mechanism is tried with, drawn with fixed
seeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from zlib import crc32

import numpy as np

from tests.hostile.mechanisms import subjects
from tests.hostile.starts import KINDS
from tests.hostile.tasks import METHODS, TASKS

EACH = 12  # cases of a mechanism
SAMPLED = (
    "five bar",
    "noisy bennett",
    "mixed loop 2",
    "two floating bodies",
    "slider crank x1 m x1e-06 kg",
    "three cranks",
)
METHOD_FREE = ("forward dynamics", "written")


@dataclass(frozen=True)
class Case:
    """Name a mechanism, a start, a task, a method and a seed."""

    subject: str
    start: str
    task: str
    method: str | None
    seed: int

    def __str__(self) -> str:
        method = [] if self.task in METHOD_FREE else [self.method or "usual method"]
        return ", ".join(
            [self.subject, f"{self.start} start", self.task, *method, f"seed {self.seed}"]
        )


def cases(names: Sequence[str] = (), each: int = EACH) -> Iterator[Case]:
    """Yield the cases of mechanisms, one mechanism after the other, so that what is compiled for
    one serves the next."""
    for name in names or subjects():
        rng = np.random.default_rng(crc32(name.encode()))
        ways = list(product(KINDS, TASKS, METHODS))
        for k, way in enumerate(rng.permutation(len(ways))[:each]):
            yield Case(name, *ways[way], seed=int(rng.integers(1000)) + k)
