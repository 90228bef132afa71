"""Chunks: the results of some members of a study, a pure function of the study and the chunk's
number."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from threading import Lock

import numpy as np

from linkwork.control import Drive
from linkwork.errors import LinkworkError
from linkwork.robot import State
from linkwork.runs.ensemble import ensemble
from linkwork.runs.quantities import QUANTITIES
from linkwork.simulation import Status
from linkwork.sweeps.home import REFUSED, UNREACHABLE
from linkwork.sweeps.measuring import measured
from linkwork.sweeps.preparation import Bench
from linkwork.sweeps.starts import starts
from linkwork.sweeps.study import Study

Results = dict[str, np.ndarray]
_LOCK = Lock()


def compute(study: Study, index: int, threads: int | None = None) -> Results:
    """Return the arrays of a chunk by name, as `Bench.fields` describes them; what a member did not
    reach is nan.

    Raises:
        KeyboardInterrupt: also where that has ended runs early.
    """
    bench = bench_of(study)
    first = index * study.chunk_length
    members = np.arange(first, min(first + study.chunk_length, study.members))
    points, cases = np.divmod(members, len(bench.cases))
    table = study.design.points(tuple(study.vary.values()), int(points[0]), int(points[-1]) + 1)
    values = table[points - points[0]][:, study.columns]
    results = empty(bench, len(members))
    results |= {name: values[:, i].copy() for i, name in enumerate(study.varied)}
    if "controller" in results:
        results["controller"][:] = cases
    for case in range(len(bench.cases)):
        (rows,) = np.nonzero(cases == case)
        if rows.size:
            run(bench, case, values, rows, results, threads)
    return results


def run(
    bench: Bench,
    case: int,
    values: np.ndarray,
    rows: np.ndarray,
    results: Results,
    threads: int | None,
) -> None:
    """Run those members (rows) that one controller leads, and put what comes of them into the
    results."""
    # Where members start; what cannot start is refused and not run.
    study = bench.study
    (state, status), parameters = starts(bench, values[rows]), bench.parameters(case, values[rows])
    for column in parameters.values():
        status[(status == 0) & np.isnan(column)] = REFUSED
    for name, drive in bench.drives.items():
        able = np.flatnonzero(status == 0)
        status[able[~startable(name, drive, state.at(able), parameters, able)]] = UNREACHABLE
    results["status"][rows], able = status, status == 0
    if not able.any():
        return
    state, rows = state.at(able), rows[able]
    # All others at once.
    runs = ensemble(
        bench.robot,
        state,
        bench.cases[case].law,
        bench.settings(threads),
        parameters={name: column[able] for name, column in parameters.items()},
        drives=bench.drives,
    )
    if (runs.status == Status.CANCELLED).any():
        raise KeyboardInterrupt
    for name in ("status", "end_time", "nfev", "pivot", "closure_error"):
        results[name][rows] = getattr(runs, name)
    # Outputs are of finished runs only; trajectories hold what there is.
    found = measured(bench, case, runs, bench.quantities, threads)
    done = runs.status == Status.FINISHED
    for name, output in bench.outputs.items():
        components = bench.labels.get(QUANTITIES[output.quantity].axis or "", ())
        results[name][rows[done]] = output.of(bench.times, found[output.quantity][done], components)
    for name in study.trajectories:
        results[name][rows] = found[name]


def startable(
    actuator: str, drive: Drive, state: State, parameters: Mapping[str, np.ndarray], who: np.ndarray
) -> np.ndarray:
    """Return in which states a drive can start that has the numbers of members (who) that vary."""
    if type(drive).require_start is Drive.require_start or actuator not in state.coordinates:
        return np.ones(len(who), bool)
    varied = [each for each in drive.numbers if f"{actuator}.{each}" in parameters]
    numbers = [parameters[f"{actuator}.{each}"][who] for each in varied]
    able = np.zeros(len(who), bool)
    for i, (x, *own) in enumerate(zip(state[actuator], *numbers, strict=True)):
        with suppress(LinkworkError):
            replace(drive, **dict(zip(varied, own, strict=True))).require_start(float(x))
            able[i] = True
    return able


def empty(bench: Bench, members: int) -> Results:
    """Return arrays for the results of some members: nan, and 0 for whole numbers."""
    return {
        name: np.full(
            bench.shape(field, members), np.nan if field.kind == "f8" else 0, dtype=field.kind
        )
        for name, field in bench.fields.items()
    }


def digest(results: Mapping[str, np.ndarray]) -> int:
    """Return a checksum of a chunk's arrays: 64 bits of BLAKE2, never 0."""
    hashed = hashlib.blake2b(digest_size=8)
    for name in sorted(results):
        values = results[name]
        hashed.update(f"{name} {values.dtype.str} {values.shape} ".encode())
        hashed.update(np.ascontiguousarray(values).tobytes())
    return int.from_bytes(hashed.digest()) or 1


def bench_of(study: Study) -> Bench:
    """Return a study made ready, once in a process."""
    with _LOCK:
        return _bench(study.text)


@lru_cache(maxsize=4)
def _bench(text: str) -> Bench:
    return Bench.of(Study.model_validate_json(text))
