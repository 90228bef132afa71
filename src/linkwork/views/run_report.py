"""The report of a run: one page that tells whose run it is, how it went, what it took, and shows
it.

It holds the mechanism, a picture and a film of the motion, the run's quantities over time, their
peaks, the energy balance, how well the loops stayed closed, and how all this was computed. Nothing
is loaded from anywhere; all names are escaped.
"""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.checks import file_path, needed, writing
from linkwork.errors import LinkworkError
from linkwork.mechanism import GearJoint, Limits, Mechanism
from linkwork.mechanism.parameter_units import with_unit
from linkwork.patience import announced
from linkwork.robot import Robot, State
from linkwork.runs.quantities import QUANTITIES, SavedQuantity
from linkwork.runs.resuming import recorded
from linkwork.scene.seen_runs import shown_robot
from linkwork.simulation import Run
from linkwork.views.film import Film, film
from linkwork.views.motion import laid_over, plot_motion, run_states
from linkwork.views.pages import PageTable, Picture, page, picture, short
from linkwork.views.plots import plot_run, units_of
from linkwork.views.style import svg

if TYPE_CHECKING:
    import xarray

FEW = 12  # joint coordinates that are all shown; of more those that are driven
SAMPLES = 600  # drawn of a run, at most
FIRST = ("tool_pose", "joint_position", "joint_rate", "command")  # of the pictures
METHODS = {"Rodas5P": "for stiff equations, with the exact Jacobian"}


@announced("writing the report")
def write_report(robot: Robot, run: Run, path: str | Path, *, over: Run | None = None) -> Path:
    """Write the report of a run as one self-contained HTML page; a file that exists is replaced.

    Args:
        robot: whose run it is, shown with the numbers that it had in it.
        run: the run, also one that ended early or holds few samples.
        path: of the page, ending in .html.
        over: another run of the robot, of the same lengths, which the film shows faintly at the
            same times.

    Raises:
        LinkworkError: a run of another robot, another suffix, a file that cannot be written.
    """
    needed(robot, Robot)
    needed(run, Run)
    if over is not None:
        needed(over, Run)
    path = file_path(path, "the path of a report")
    if path.suffix.lower() not in (".html", ".htm"):
        raise LinkworkError(f"a report is written as .html, not as {path.name!r}")
    text = render(shown_robot(robot, run), run, over)
    with writing(path):
        path.write_text(text, encoding="utf-8")
    return path


def render(robot: Robot, run: Run, over: Run | None = None) -> str:
    """Return the report as a page."""
    # A run that ended at once has no states to be shown; curves and film are smooth.
    drawn = run.smooth
    time = np.asarray(drawn.time, float)
    states = run_states(robot, drawn) if len(time) else None
    data = drawn.dataset
    return page(
        "run.html",
        name=robot.mechanism.name,
        robot=robot,
        run=run,
        time=time,
        planar="planar" if robot.planar else "spatial",
        loops=robot.equations.topology.loops,
        portrait=None if states is None else portrait(robot, states),
        film=moving(robot, time, states, over),
        over=over,
        plots=list(plots(data)),
        shown=min(len(time), SAMPLES),
        bodies=bodies_table(robot.mechanism),
        joints=joints_table(robot),
        peaks=list(peaks(data)),
        energy=energy_table(data),
        balance=largest(data, "energy_balance"),
        closure=closure_table(run),
        computed=computed_table(robot, run),
        description=robot.mechanism.text,
        made_by=(
            f"Linkwork {version('linkwork')}, NumPy {np.__version__}, Python "
            f"{platform.python_version()}"
        ),
    )


def portrait(robot: Robot, states: State) -> Picture:
    """Draw the robot along its motion."""
    axes: Any = plot_motion(robot, states)
    caption = (
        "The mechanism along its motion, the latest pose in full. Orange: what is driven; "
        "arrows: the tool's axes."
    )
    return picture("motion", caption, svg(axes.figure, cropped=True))


def moving(robot: Robot, time: np.ndarray, states: State | None, over: Run | None) -> Film | None:
    """Make the film of a run, if it has two samples or more, with another one laid over."""
    faint = None
    if over is not None:
        faint = laid_over(robot, over)
    return None if states is None or len(time) < 2 else film(robot, time, states, over=faint)


def plots(data: xarray.Dataset) -> Iterator[Picture]:
    """Draw the run's quantities over time."""
    count = data.sizes["time"]
    if not count:
        return
    thin = data.isel(time=np.unique(np.linspace(0, count - 1, SAMPLES).round().astype(int)))
    if "command" in thin and np.array_equal(thin["command"], thin["actuator_force"]):
        thin = thin.drop_vars("command")  # of ideal drives
    for quantity in pictured():
        name = quantity.name
        if name in thin and thin[name].size:
            drawing = svg(plot_run(driven(thin, name), name))
            yield picture(name.replace("_", "-"), quantity.caption, drawing)
    energies = energies_of(thin)
    if energies:
        caption = (
            "Energy: kinetic, potential, work done on the mechanism, and what the sum is off by."
        )
        yield picture("energy", caption, svg(plot_run(thin, energies)))


def pictured() -> list[SavedQuantity]:
    """Return the quantities that have pictures of their own, the first ones first."""
    found = [each for each in QUANTITIES.values() if each.caption]
    return sorted(found, key=lambda each: (*FIRST, each.name).index(each.name))


def peaks(data: xarray.Dataset) -> Iterator[PageTable]:
    """Yield the tables of peaks of what has a picture, components and a unit of its own."""
    for each in pictured():
        table = peaks_table(data, each.name) if each.axes and each.unit else None
        if table is not None:
            yield table


def energies_of(data: xarray.Dataset) -> list[str]:
    """Return the energies that a dataset holds, which share a picture and a table."""
    told = [each.name for each in QUANTITIES.values() if each.unit == "J" and not each.axes]
    return [name for name in told if name in data]


def driven(data: xarray.Dataset, name: str) -> xarray.Dataset:
    """Return a dataset with few components of a quantity: of many joint coordinates or rates those
    that are driven."""
    for axis in ("coordinate", "rate"):
        if axis in data[name].dims and data.sizes[axis] > FEW:
            kept = np.isin(data[axis].values, data["actuator"].values)
            if kept.any():
                units = np.array(str(data[axis].attrs["unit_of_each"]).split(", "))[kept]
                data = data.isel({axis: kept})
                data[axis].attrs["unit_of_each"] = ", ".join(units)
    return data


# Tables


def bodies_table(mechanism: Mechanism) -> PageTable:
    """Return masses, mass centres and inertias of the bodies; bodies alike share a row."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for name, body in mechanism.bodies.items():
        tensor = body.inertia.tensor()
        untold = 2 * (body.inertia.planar and body.inertia.zz > 0)  # of a planar body: xx and yy
        entries = (
            short(body.mass, 6),
            ", ".join(short(x, 4) for x in body.centre_of_mass),
            ", ".join(["–"] * untold + [short(x, 4) for x in np.diag(tensor)[untold:]]),
            ", ".join(short(x, 4) for x in tensor[[0, 0, 1], [1, 2, 2]])
            if tensor[[0, 0, 1], [1, 2, 2]].any()
            else "–",
        )
        alike.setdefault(entries, []).append(name)
    caption = (
        "Bodies: mass, mass centre in the body's frame, and inertia about the mass centre: "
        "moments xx, yy, zz and products xy, xz, yz."
    )
    header = ("bodies", "mass [kg]", "mass centre [m]", "moments [kg m²]", "products [kg m²]")
    return PageTable(
        caption, header, [(", ".join(names), *entries) for entries, names in alike.items()]
    )


def joints_table(robot: Robot) -> PageTable:
    """Return the joints: type, bodies, what is driven, and limits."""
    rows = []
    for name, joint in robot.mechanism.joints.items():
        gear = isinstance(joint, GearJoint)
        between = (
            " + ".join(f"{c:g} {of}{power}" for of, c, power in gear_terms(joint))
            if gear
            else " – ".join(joint.connects)
        )
        driven = [rate for rate in joint.rates(name) if rate in robot.actuators]
        bounds = [
            f"{label} {bound(effects.limits)}"
            for label, effects in joint.effects().items()
            if effects.limits != Limits()
        ]
        rows.append((name, joint.type, between, ", ".join(driven) or "–", "; ".join(bounds) or "–"))
    return PageTable(
        "Joints.",
        ("joint", "type", "connects", "driven", "limits [m, rad, s]"),
        rows,
        numbers=False,
    )


def gear_terms(gear: GearJoint) -> Iterator[tuple[str, float, str]]:
    """Yield coordinate, coefficient and written power of what a gear adds up."""
    for label in gear.coupled:
        for power, c in enumerate(gear.polynomial(label), start=1):
            if c:
                yield label, c, f"^{power}" if power > 1 else ""


def bound(limits: Limits) -> str:
    """Return limits as text: ≥ 0.1, ≤ 2, speed ≤ 3."""
    ends = ("≥", limits.lower), ("≤", limits.upper), ("speed ≤", limits.speed)
    return ", ".join(f"{sign} {short(end, 6)}" for sign, end in ends if end is not None)


def peaks_table(data: xarray.Dataset, name: str) -> PageTable | None:
    """Return smallest and largest values of a quantity with their times, its root mean square and
    its last value."""
    if name not in data or not data[name].size:
        return None
    data = driven(data, name)
    array, time = data[name].transpose("time", ...), data["time"].values
    labels = [str(label) for label in array[array.dims[1]].values]
    units = units_of(data, name, labels)
    rows = []
    for label, unit, values in zip(labels, units, array.values.T, strict=True):
        low, high = int(values.argmin()), int(values.argmax())
        entries = (
            values[low],
            time[low],
            values[high],
            time[high],
            np.sqrt(np.mean(values**2)),
            values[-1],
        )
        rows.append((f"{label} [{unit}]", *(short(float(entry), 4) for entry in entries)))
    header = (
        name.replace("_", " "),
        "least",
        "at [s]",
        "most",
        "at [s]",
        "root mean square",
        "at the end",
    )
    return PageTable(f"Peaks of the {name.replace('_', ' ')} at the saved times.", header, rows)


def energy_table(data: xarray.Dataset) -> PageTable | None:
    """Return the energy balance at the start, at the end, and its extremes."""
    names = [name for name in energies_of(data) if data[name].size]
    if not names:
        return None
    rows = []
    for name in names:
        values = data[name].values
        entries = (values[0], values[-1], values[-1] - values[0], values.min(), values.max())
        rows.append((name.replace("_", " "), *(short(float(entry), 4) for entry in entries)))
    caption = (
        "Energy. The balance is kinetic and potential energy less those at the start and less "
        "the work done by actuators, friction, dampers and external wrenches: zero for the "
        "exact motion."
    )
    header = ("energy", "at the start [J]", "at the end [J]", "change [J]", "least [J]", "most [J]")
    return PageTable(caption, header, rows)


def closure_table(run: Run) -> PageTable:
    """Return how well the loops stayed closed and how well posed the equations were."""
    saved = (
        run.variables["closure_error"].values if "closure_error" in run.variables else np.empty(0)
    )
    pivot = run.statistics.pivot
    rows = [
        ("largest gap of a loop over all steps [own lengths, rad]", short(run.closure_error)),
        (
            "largest gap at the saved times [own lengths, rad]",
            short(float(saved.max())) if saved.size else "–",
        ),
        (
            "smallest relative pivot",
            f"{short(pivot, 3)} at {short(run.statistics.pivot_time, 4)} s",
        ),
    ]
    return PageTable(
        "Closure of the loops, and the weakest pivot of the equations (1 well posed, 0 singular).",
        ("", ""),
        rows,
    )


def computed_table(robot: Robot, run: Run) -> PageTable:
    """Return how the run was computed."""
    told, statistics = run.attrs, run.statistics
    method = str(told.get("method", "Dormand-Prince 5(4)"))
    rtol, atol = (short(float(told.get(name, np.nan))) for name in ("rtol", "atol"))
    accuracy = f"relative tolerance {rtol}, absolute {atol}"
    if "step" in told:
        accuracy = f"steps of {short(float(told['step']), 4)} s"
    rows = [
        ("method", ", ".join([method, *[METHODS[m] for m in METHODS if m == method], accuracy])),
        ("steps", f"{run.steps:,} taken, {run.rejected:,} rejected"),
        (
            "evaluations",
            (
                f"{run.nfev:,} of the equations of motion, {statistics.projections:,} "
                "projections on closed loops"
            ),
        ),
        ("independent rates", str(told.get("charts", "–"))),
        (
            "equations of motion",
            (
                f"{robot.kernel('motion').operations:,} arithmetic operations, compiled to "
                "machine code"
            ),
        ),
    ]
    if given := recorded(run):
        shown = (with_unit(robot.mechanism, n, f"{n} = {x!r}") for n, x in given.items())
        rows.append(("parameters", ", ".join(shown)))
    return PageTable("How the run was computed.", ("", ""), rows, numbers=False)


def largest(data: xarray.Dataset, name: str) -> float | None:
    """Return the largest magnitude of a quantity; nothing if the run does not hold it."""
    return float(np.abs(data[name].values).max()) if name in data and data[name].size else None
