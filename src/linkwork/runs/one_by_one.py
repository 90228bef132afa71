"""One by one: members of an ensemble that run by themselves, each as `Robot.simulate` runs it,
dealt to threads.

The compiled loop runs without Python's lock. A Python function that controls a robot needs the
lock, and may keep memory: then the members run one after the other, in their order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Event
from typing import NamedTuple

from linkwork.model import chart_transfer
from linkwork.runs.endings import ending, statistics
from linkwork.runs.members import Members
from linkwork.runs.passage import Departure, Passage, Segment, Stand
from linkwork.runs.settings import Settings
from linkwork.simulation import Statistics, Status
from linkwork.threads import dealt, usable_processors

CHUNKS_PER_THREAD = 16
Progress = Callable[[int, int], None]


class Task(NamedTuple):
    """Name a member to run: from its start, or from where its first segments ended, the last of
    which began at a stand."""

    member: int
    before: Sequence[Segment] = ()
    stand: Stand | None = None


@dataclass(frozen=True, eq=False)
class SingleRun:
    """Hold what became of a member that was run by itself."""

    member: int
    segments: Sequence[Segment]
    status: Status
    message: str

    @cached_property
    def statistics(self) -> Statistics:
        """What the run took."""
        return statistics(self.segments)


def by_themselves(
    batch: Members, settings: Settings, tasks: Sequence[Task], report: Progress
) -> list[SingleRun]:
    """Run members, each from chart to chart; those that KeyboardInterrupt leaves out are not
    returned."""
    sampler = batch.system.sampler
    threads = 1 if sampler and not sampler.compiled else settings.threads or usable_processors()
    size = -(-len(tasks) // (CHUNKS_PER_THREAD * threads)) or 1
    chunks = [tasks[first : first + size] for first in range(0, len(tasks), size)]
    done: list[SingleRun] = []
    cancel = Event()

    def run(i: int) -> bool:
        for task in chunks[i]:
            if cancel.is_set():
                return False
            done.append(led(batch, settings, task))
        return True

    dealt(
        run,
        len(chunks),
        threads,
        lambda: report(len(batch) - len(tasks) + len(done), len(batch)),
        cancel.set,
    )
    return done


def led(batch: Members, settings: Settings, task: Task) -> SingleRun:
    """Run one member to its end."""
    robot, system = batch.alone(task.member)
    passage = Passage(robot, system, 0.0, settings.duration, settings)

    if task.stand is None:
        state = batch.state(task.member)
        chart, v = chart_transfer.start(robot, state)
        z = system.start(robot, state.positions, state.q)
        segments = list(passage.segments(Departure(chart, state.q, v, z)))
    else:
        stand = task.stand._replace(chart=task.stand.chart.with_parameters(robot.p))
        here = passage.after(stand, task.before[-1].trajectory)
        segments = [*task.before, *passage.onward(here)]
    for fault in system.faults:
        if not isinstance(fault, Exception):
            raise fault
    return SingleRun(task.member, segments, *ending(system, segments))
