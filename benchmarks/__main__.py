"""Run the benchmarks: `python -m benchmarks [names...]`; a page of them writes its tables in
`benchmarks/results`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter

from rich.console import Console

from linkwork.kernels.machine import this_machine

from benchmarks import (
    accuracy,
    analysis,
    calls,
    catalogue,
    control,
    ensemble,
    export,
    frameworks,
    gradients,
    growth,
    kernel,
    ladder,
    learning,
    legs,
    linkages,
    machine,
    others,
    seeing,
    single,
    stepper,
    stewart,
    stiff,
    trajectories,
    work_precision,
)
from benchmarks.table import Page, Section, markdown, terminal

RESULTS = Path(__file__).parent / "results"
COMMAND = "python -m benchmarks"
Sections = Mapping[str, Callable[[machine.Machine], Section]]
PAGES: Mapping[str, Sections] = {
    "foundation": {
        "kernel": kernel.run,
        "others": lambda _: others.run(),
        "work_precision": lambda _: work_precision.run(),
        "accuracy": lambda _: accuracy.run(),
    },
    "mechanisms": {
        "stewart": lambda _: stewart.run(),
        "ladder": lambda _: ladder.run(),
        "growth": lambda _: growth.run(),
        "linkages": lambda _: linkages.run(),
        "catalogue": lambda _: catalogue.run(),
        "export": lambda _: export.run(),
        "gradients": lambda _: gradients.run(),
        "jax": lambda _: frameworks.run(),
    },
    "simulation": {
        "single": lambda _: single.run(),
        "plain": lambda _: single.plain(),
        "changing": lambda _: single.changing(),
        "ensemble": lambda _: ensemble.run(),
        "stepper": lambda _: stepper.run(),
        "learning": lambda _: learning.run(),
        "control": lambda _: control.run(),
        "stiff": lambda _: stiff.run(),
        "trajectories": lambda _: trajectories.run(),
    },
    "analysis": {
        "calls": lambda _: calls.run(),
        "modes": lambda _: analysis.modes(),
        "workspace": lambda _: analysis.maps(),
        "legs": lambda _: legs.run(),
        "drag": lambda _: seeing.drag(),
        "report": lambda _: seeing.report(),
    },
}


def main(names: Sequence[str]) -> int:
    """Run the named sections and pages, or all; print them, and write the results of each whole
    page."""
    console = Console(width=80)
    known = [*PAGES, *(name for sections in PAGES.values() for name in sections)]
    if unknown := [name for name in names if name not in known]:
        console.print(
            f"there is no benchmark {unknown[0]!r}; the benchmarks are {', '.join(known)}"
        )
        return 2
    host = machine.describe(this_machine().lanes)
    for title, line in host.lines().items():
        console.print(f"{title}: {line}", highlight=False)
    command = " ".join([COMMAND, *names])
    for page, sections in PAGES.items():
        whole = not names or page in names
        start, done = perf_counter(), []
        for name, run in sections.items():
            if whole or name in names:
                console.print()
                done.append(run(host))
                console.print(terminal(done[-1]))
        if whole:
            write(Page(page.capitalize(), page, done), host, command, perf_counter() - start)
    return 0


def write(page: Page, host: machine.Machine, command: str, seconds: float) -> None:
    """Write the tables, the raw numbers and the pictures of one run of a page."""
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{page.name}.md").write_text(markdown(page, host, command, seconds))
    raw = {
        "machine": host.as_dict(),
        "seconds": seconds,
        "sections": {
            section.title: {
                "figures": [vars(figure) for figure in section.figures],
                "raw": section.raw,
            }
            for section in page.sections
        },
    }
    (RESULTS / f"{page.name}.json").write_text(json.dumps(raw, indent=1) + "\n")
    for section in page.sections:
        for name, picture in section.pictures.items():
            (RESULTS / name).write_text(picture)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
