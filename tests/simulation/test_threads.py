"""Jobs that are dealt to threads: in each other, at the same time, and in a child process."""

import os
import threading

import pytest

from linkwork.threads import dealt


def counted(parts: int, threads: int, inside: int = 0) -> int:
    """Return how many parts of a job were done, each after an own job of so many parts."""
    done: list[int] = []

    def part(number: int) -> bool:
        done.append(counted(inside, threads) if inside else 1)
        return True

    dealt(part, parts, threads, lambda: None, lambda: None)
    return sum(done)


def test_a_job_inside_of_each_part_of_a_job_has_threads_of_its_own():
    assert counted(8, 2, inside=3) == 24


def test_jobs_at_the_same_time_are_each_done_whole():
    done: list[int] = []
    jobs = [threading.Thread(target=lambda: done.append(counted(50, 2))) for _ in range(6)]
    for job in jobs:
        job.start()
    for job in jobs:
        job.join(timeout=60)
    assert done == [50] * 6


def test_what_a_part_raises_ends_the_job_and_the_next_one_is_done():
    def part(number: int) -> bool:
        raise ValueError(f"part {number}")

    with pytest.raises(ValueError, match="part 0"):
        dealt(part, 1, 1, lambda: None, lambda: None)
    assert counted(3, 1) == 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_child_has_threads_of_its_own():
    assert counted(2, 2) == 2  # leaves threads that wait
    child = os.fork()
    if not child:
        os._exit(0 if counted(4, 2) == 4 else 1)
    limit = threading.Timer(30, os.kill, (child, 9))
    limit.start()
    assert os.waitpid(child, 0)[1] == 0
    limit.cancel()
