"""Tables: motions as text, comma-separated, a row for each time, for other programs and back.

The columns are time [s], then of each coordinate x the value "x", its rate "x'" and its
acceleration "x''" [m, rad, s]; forces of actuators are "u x". Empty lines and those that begin with
# are passed over. A table without rates is read as a spline through its values, one with rates as
polynomials that have them, and accelerations if these are there, at each row.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np

from linkwork import checks
from linkwork.equations.algebra import wrapped
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism.task import labels
from linkwork.model.labels import POSES
from linkwork.model.state import Motion
from linkwork.model.task import asked_of
from linkwork.motions.profiles import Profile
from linkwork.motions.timed_paths import TimedPath, sample_count
from linkwork.robot import Robot
from linkwork.simulation import Sampled

TIME, FORCE, REMARK = "time", "u ", "#"
MARKS = ("", "'", "''")


def write_csv(
    path: str | FilePath,
    motion: Motion | TimedPath,
    robot: Robot | None = None,
    *,
    forces: Sampled | None = None,
    samples: int = 101,
) -> FilePath:
    """Write a motion, or a timed path, as a table; numbers are told to the last digit.

    Args:
        path: of the file; one that exists is replaced.
        motion: what `follow` or `Robot.follow` returns, or a timed path.
        robot: whose motion it is; of timed paths for those of a tool only.
        forces: of its actuators, from `Robot.inverse_dynamics`.
        samples: number of equally spaced times of a timed path.

    Raises:
        LinkworkError: a motion without its robot, forces at other times; a file that cannot be
            written.
    """
    # The columns of the motion, by name.
    if robot is not None:
        checks.needed(robot, Robot)
    if isinstance(motion, TimedPath):
        columns = of_path(motion, samples, robot)
    elif isinstance(motion, Motion):
        if robot is None:
            raise LinkworkError("a motion is written with the names of its robot; give robot=")
        columns = of_motion(motion, robot)
    else:
        raise LinkworkError(
            f"what is written is {checks.shown(motion)}; give a motion or a timed path"
        )
    # Those of the forces, at the same times.
    if forces is not None:
        if not isinstance(forces, Sampled):
            raise LinkworkError(
                f"the forces are {checks.shown(forces)}; give those of "
                "robot.inverse_dynamics(motion), a linkwork.Sampled"
            )
        if robot is None or not np.array_equal(forces.times, columns[TIME]):
            raise LinkworkError(
                "forces are written at the times of the motion, with the robot that they drive; "
                "give those of robot.inverse_dynamics(motion)"
            )
        values = zip(robot.actuators, forces.values.T, strict=True)
        columns = apart(columns, {f"{FORCE}{name}": value for name, value in values})
    # A row for each time.
    target = checks.file_path(path, "the path")
    with checks.writing(target), target.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(np.stack([*columns.values()], axis=1).tolist())
    return target


def of_path(timed: TimedPath, samples: int, robot: Robot | None) -> dict[str, np.ndarray]:
    """Return the columns of a timed path."""
    time = np.linspace(0, timed.duration, sample_count(samples))
    parts = timed.sample(time)
    return apart({TIME: time}, marked(labels_of(timed, parts[0].shape[1], robot), parts))


def labels_of(timed: TimedPath, count: int, robot: Robot | None = None) -> tuple[str, ...]:
    """Return the names of a path's coordinates: joints', or those in which the robot's tool is led
    by so many; without a robot, those of a pose."""
    if timed.names:
        return timed.names
    if robot is not None:
        return labels(asked_of(robot, count).what)
    if count not in (2, 6):
        raise LinkworkError(
            f"the {count} coordinates of the path are those of a tool's task, or of a pose in the "
            "plane or in space; say which by robot="
        )
    return POSES[False][:count]


def of_motion(motion: Motion, robot: Robot) -> dict[str, np.ndarray]:
    """Return the columns of a motion of all joints; a quaternion has values only."""
    if motion.state.coordinates != robot.coordinates:
        raise LinkworkError(
            f"the motion is of the joints {', '.join(motion.state.coordinates)}, the robot has "
            f"{', '.join(robot.coordinates)}; give the robot that was led"
        )
    columns = {TIME: motion.time}
    for name, values in zip(robot.coordinates, motion.positions.T, strict=True):
        parts = [values]
        if name in robot.rates:
            place = robot.rates.index(name)
            parts += [motion.joint_rates[:, place], motion.joint_accelerations[:, place]]
        named = zip(MARKS, parts, strict=False)
        columns = apart(columns, {f"{name}{mark}": part for mark, part in named})
    return columns


def apart(columns: dict[str, np.ndarray], more: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns and more of them; refuse a name that both have."""
    for name in more:
        if name in columns:
            raise LinkworkError(
                f"two columns of the table would be called {name!r}: a joint has that name; rename "
                "it"
            )
    return columns | more


def marked(names: Sequence[str], parts: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Return coordinates, rates and accelerations (K, d) as columns."""
    return {
        f"{name}{mark}": part[:, k]
        for k, name in enumerate(names)
        for mark, part in zip(MARKS, parts, strict=True)
    }


def read_csv(path: str | FilePath, names: Sequence[str] = ()) -> TimedPath:
    """Read a table of joint coordinates over time as a timed path.

    Args:
        path: of the file, with columns as `write_csv` writes them; units are m, rad and s.
        names: joints to take, such as `robot.actuators`; all columns of values if left out.

    Returns:
        A timed path of these joints, through all rows: polynomials of degree 5 where rates and
        accelerations are there, of degree 3 where rates are, else a cubic spline.

    Raises:
        LinkworkError: a file that cannot be read or has no such columns, a row that is no row of
            finite numbers, by its line; times that do not increase.

    Warns:
        ModelWarning: a column leaps like an angle that begins anew after a whole turn.
    """
    asked = checks.names(names, "names")
    columns = read_columns(checks.file_path(path, "the path"))
    rates = {f"{name}{mark}" for name in columns for mark in MARKS[1:]}
    wanted = [*asked] or [
        name
        for name in columns
        if name != TIME and name not in rates and not name.startswith(FORCE)
    ]
    checks.known(wanted, [*columns], "column")
    if not wanted:
        raise LinkworkError(f"'{path}' has no column of a coordinate beside the time")
    # Accelerations without rates are passed over, for polynomials take derivatives in their order.
    there = [all(f"{name}{mark}" in columns for name in wanted) for mark in MARKS]
    given = MARKS[: [*there, False].index(False)]
    parts = [np.stack([columns[f"{name}{mark}"] for name in wanted], axis=1) for mark in given]
    warn_of_turns(path, columns[TIME], parts[0], wanted)
    time = columns[TIME] - columns[TIME][0]
    profile = splined(time, parts[0]) if len(parts) == 1 else joined(time, parts)
    return TimedPath.of(profile, tuple(wanted), ())


def warn_of_turns(
    path: str | FilePath, time: np.ndarray, values: np.ndarray, names: Sequence[str]
) -> None:
    """Warn of the first leap between rows (K, d) that would be a step like its neighbours but for
    a whole turn."""
    steps = np.pad(np.diff(values, axis=0), ((1, 1), (0, 0)))
    beside = np.maximum(np.abs(steps[:-2]), np.abs(steps[2:]))
    step = steps[1:-1]
    leaps = (np.abs(step) > np.maximum(np.pi, 4 * beside)) & (np.abs(wrapped(step)) < 2 * beside)
    for row, column in np.argwhere(leaps)[:1].tolist():
        warnings.warn(
            f"'{path}': {names[column]} leaps by {step[row, column]:.4g} between "
            f"{time[row]:.6g} s and {time[row + 1]:.6g} s, as angles do that are told within one "
            "turn; the path goes all the way in that time: if none is meant, add the whole turns "
            "(numpy.unwrap)",
            ModelWarning,
            stacklevel=3,
        )


def rows_of(path: FilePath) -> list[tuple[int, list[str]]]:
    """Return the rows of a table with the numbers of their lines, without empty lines and
    remarks."""
    try:
        read = csv.reader(path.read_text(encoding="utf-8-sig").splitlines())
        return [
            (read.line_num, row)
            for row in read
            if any(text.strip() for text in row) and not row[0].lstrip().startswith(REMARK)
        ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise LinkworkError(f"'{path}' cannot be read as a table: {reason}") from None


def read_columns(path: FilePath) -> Mapping[str, np.ndarray]:
    """Return the columns of a table by name."""
    rows = rows_of(path)
    header = [name.strip() for name in rows[0][1]] if rows else []
    if TIME not in header or len({*header}) < len(header):
        raise LinkworkError(
            f"'{path}' begins with {checks.shown(','.join(header))}; give a first line with the "
            "names of the columns, each once, 'time' among them"
        )
    numbers = []
    for line, row in rows[1:]:
        with checks.at(f"'{path}', line {line}: "):
            if len(row) != len(header):
                raise LinkworkError(f"it has {len(row)} values; give {len(header)}")
            numbers.append([number(text, name) for text, name in zip(row, header, strict=True)])
    if len(numbers) < 2:
        raise LinkworkError(f"'{path}' has {len(numbers)} rows of numbers; give at least 2")
    found = dict(zip(header, np.array(numbers).T, strict=True))
    late = np.diff(found[TIME]) <= 0
    if late.any():
        k = int(np.argmax(late))
        raise LinkworkError(
            f"'{path}': the time {found[TIME][k + 1]:g} s follows {found[TIME][k]:g} s; times have "
            "to increase"
        )
    return found


def number(text: str, name: str) -> float:
    """Return a finite number that is written in a cell."""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise LinkworkError(f"{name} is {checks.shown(text)}; give a finite number")
    return value


def splined(time: np.ndarray, values: np.ndarray) -> Profile:
    """Return the cubic spline through values (K, d)."""
    signal = Sampled(time, values).signal
    return Profile(signal.knots, signal.coefficients)


def joined(time: np.ndarray, parts: Sequence[np.ndarray]) -> Profile:
    """Return polynomials that have values, rates, and accelerations if given, at each time
    (Hermite)."""
    count, h = len(parts), np.diff(time)[:, None]
    powers = np.arange(2 * count)
    rows = np.zeros((len(h), 2 * count, parts[0].shape[1]))
    factors = np.ones(2 * count)
    slopes = []
    for order, part in enumerate(parts):
        rows[:, order] = part[:-1] / np.prod(np.arange(1.0, order + 1)) * h**order
        slopes.append(factors.copy())
        factors = factors * (powers - order)
    # At the end of each piece, in its own time from 0 to 1: the upper half of the powers.
    upper = np.array([slope[count:] for slope in slopes])
    ends = np.stack(
        [
            part[1:] * h**order - np.einsum("p,kpd->kd", slopes[order][:count], rows[:, :count])
            for order, part in enumerate(parts)
        ],
        axis=1,
    )
    rows[:, count:] = np.linalg.solve(upper, ends)
    return Profile(time, rows / h[:, None] ** powers[:, None])
