"""Run the benchmarks: `python -m benchmarks [names...]`; all of them write the tables in `benchmarks/results`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from rich.console import Console

from linkwork.kernels.machine import this_machine

from benchmarks import accuracy, kernel, machine, others, work_precision
from benchmarks.table import Section, markdown, terminal

RESULTS = Path(__file__).parent / "results"
COMMAND = "python -m benchmarks"


def main(names: Sequence[str]) -> int:
    """Run the named sections, or all; print them, and write the results where all were run."""
    console = Console(width=80)
    host = machine.describe(this_machine().lanes)
    sections: dict[str, Callable[[], Section]] = {
        "kernel": lambda: kernel.run(host),
        "others": others.run,
        "work_precision": work_precision.run,
        "accuracy": accuracy.run,
    }
    if unknown := [name for name in names if name not in sections]:
        console.print(f"there is no benchmark {unknown[0]!r}; the benchmarks are {', '.join(sections)}")
        return 2
    for title, line in host.lines().items():
        console.print(f"{title}: {line}", highlight=False)
    start, done = perf_counter(), []
    for name in names or sections:
        console.print()
        done.append(sections[name]())
        console.print(terminal(done[-1]))
    if not names:
        write(done, host, perf_counter() - start)
    return 0


def write(sections: Sequence[Section], host: machine.Machine, seconds: float) -> None:
    """Write the table, the raw numbers and the pictures of one run of all sections."""
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "foundation.md").write_text(markdown(sections, host, COMMAND, seconds))
    raw = {
        "machine": host.as_dict(),
        "seconds": seconds,
        "sections": {
            section.title: {"figures": [vars(figure) for figure in section.figures], "raw": section.raw}
            for section in sections
        },
    }
    (RESULTS / "foundation.json").write_text(json.dumps(raw, indent=1) + "\n")
    for section in sections:
        for name, picture in section.pictures.items():
            (RESULTS / name).write_text(picture)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
