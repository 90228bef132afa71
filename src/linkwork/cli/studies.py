"""What `linkwork analyse` does: each subject computes by `linkwork.analysis`, and prints tables
that fit 80 columns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork import analysis
from linkwork.checks import amount
from linkwork.cli.catalogue import built, refuse_unwritable
from linkwork.cli.entries import by_name, names, number
from linkwork.cli.grid_words import axes, ranges
from linkwork.cli.poses import (
    FEW,
    equilibrium_told,
    joints_told,
    modes_at,
    pose_of,
    pose_told,
    states_told,
    tidied,
)
from linkwork.cli.source import Source
from linkwork.cli.start import StartOptions, joints_given, tool_given
from linkwork.cli.terminal import console, facts, patience, show_json, table, tidy
from linkwork.equations.body_motion import pose_places
from linkwork.errors import LinkworkError
from linkwork.model.labels import POSES
from linkwork.model.task import task_if_any
from linkwork.robot import Robot, State
from linkwork.simulation import Run

if TYPE_CHECKING:
    import xarray
    from rich.console import Group

MODES_TOLD = ("sure", "missing", "starts", "converged", "what", "asked", "hits", "within_limits")
LINEAR_TOLD = ("states", "inputs", "outputs", "A", "B", "C", "D", "poles", "controllable")
NATURAL_TOLD = ("frequencies", "shapes", "stable", "independent")
IDENTIFIED_TOLD = ("names", "values", "deviations", "described", "condition")
FAR = 1e9  # times the robot's size, or rad: from there on a slope is rounding
PICTURES = (".svg", ".pdf", ".png")


@dataclass(frozen=True)
class Map:
    """Say what is mapped, and where it is written."""

    grid: str
    limits: str | None
    rates: str | None
    forces: str | None
    quantity: str | None
    out: Path | None
    picture: Path | None
    overwrite: bool

    def check(self) -> None:
        """Refuse what cannot be written, and a quantity that nothing shows, before anything is
        computed."""
        if self.quantity is not None and self.picture is None:
            raise LinkworkError("--quantity says what a picture shows; give --picture, too")
        for option, file, suffixes in (
            ("--out", self.out, (".nc",)),
            ("--picture", self.picture, PICTURES),
        ):
            if file is None:
                continue
            if file.suffix.lower() not in suffixes:
                raise LinkworkError(
                    f"{option} {file}: give a name that ends in {' or '.join(suffixes)}, not "
                    f"{file.suffix!r}"
                )
            refuse_unwritable(option, file, self.overwrite)


def modes(
    source: Source,
    joints: str | None,
    tool: str | None,
    starts: int,
    seed: int,
    as_json: bool,
) -> None:
    """Print all assembly modes or working modes, and how sure their number is."""
    if joints is not None and tool is not None:
        raise LinkworkError(
            "--joints and --tool are both given; the one asks for assembly modes, the other for "
            "working modes"
        )
    robot, working = made(source), tool is not None
    with patience("looking for all solutions"):
        if tool is not None:
            given = tool_given(robot, tool)
            what = tuple(given) if isinstance(given, dict) else None
            values = list(given.values()) if isinstance(given, dict) else given
            found = analysis.working_modes(robot, values, what=what, starts=starts, seed=seed)
        else:
            asked = None if joints is None else joints_given(robot, joints)
            found = analysis.assembly_modes(robot, asked, starts=starts, seed=seed)
    if as_json:
        told = {name: getattr(found, name) for name in MODES_TOLD}
        show_json({"count": len(found)} | told | {"modes": states_told(robot, found.states)})
        return
    # How many there are, and how sure that is.
    values = zip(found.what, found.asked, strict=True)
    rows = [
        (
            f"{'working' if working else 'assembly'} modes",
            f"{len(found)}{' (sure)' if found.sure else ''}",
        ),
        ("with", ", ".join(f"{label} = {value:.6g}" for label, value in values)),
        ("starts", f"{found.starts}, of which {found.converged} ended in a solution"),
        ("last one found", f"by start {found.first.max() + 1}" if len(found) else "none"),
        ("likely missing", f"{found.missing:.2g}"),
    ]
    out = console()
    out.print(facts(rows))
    if len(found):
        out.print()
        out.print(modes_table(robot, found, working))


def modes_table(robot: Robot, found: analysis.Modes, working: bool) -> Group:
    """Return what was not asked of each mode, a line each: the actuators, the tool's pose, or the
    first coordinates; how many starts ended there, and whether it is within the joints' limits."""
    if robot.mechanism.tools and not working:
        shown = POSES[robot.planar]
        numbers = tidied(robot, robot.tool_pose(found.states))
    else:
        shown = (robot.actuators if working else robot.coordinates)[:FEW]
        own = [robot.coordinates.index(label) for label in shown if label in robot.coordinates]
        numbers = found.states.positions[:, own]
    lines = [
        (str(k), *(f"{value:.5g}" for value in row), str(hits), "yes" if inside else "no")
        for k, (row, hits, inside) in enumerate(
            zip(numbers, found.hits, found.within_limits, strict=True), start=1
        )
    ]
    return table(("", *shown, "hits", "in limits"), lines, numbers=range(len(shown) + 2))


def singularities(
    source: Source, joints: str | None, tool: str | None, what: str | None, as_json: bool
) -> None:
    """Print of which kinds a configuration is singular."""
    # Which kinds the configuration is of.
    robot = made(source)
    state = configuration(robot, joints, tool)
    with patience("judging the configuration"):
        told = analysis.singularity(robot, state, what=names(what))
    near = None
    if what is None and not (told.tool or told.kinds) and task_if_any(robot):
        stack = robot.make_state(state.q[None], np.zeros((1, robot.mobility)))
        near = analysis.along(robot, stack).isel(sample=0)
    if as_json:
        ways = {} if near is None else {str(name): near[name].values for name in near.data_vars}
        found = vars(told) | {"message": told.message, "near": ways or None}
        show_json({"joints": joints_told(robot, state), "pose": pose_told(robot, state)} | found)
        return
    rows = [
        ("configuration", pose_of(robot, state)),
        ("singular", f"{', '.join(told.kinds) or 'no'}: {told.message}"),
        ("leg", f"{told.leg:.4g}  smallest over largest singular value; 0: kind I"),
        ("actuator", f"{told.actuator:.4g}  0: kind II"),
        ("constraint", f"{told.constraint:.4g}  0: the loops let go"),
    ]
    # What a singular one lets the tool do; how far a regular one is from being singular.
    if told.tool:
        rows.append(
            ("free motion", ", ".join(f"{label} {value:.4g}" for label, value in told.tool.items()))
        )
    elif near is not None:
        out, into = (near[name].attrs["units"] for name in ("tool_distance", "actuator_distance"))
        rows += [
            (
                "det A, det B",
                f"{float(near.det_A):.4g}, {float(near.det_B):.4g}  over those at the reference",
            ),
            (
                "conditioning",
                (
                    f"{float(near.conditioning):.4g}  1 / cond, l = "
                    f"{near.attrs['characteristic_length']:.4g} m"
                ),
            ),
            ("way to kind II", way(near, "tool_distance", f"{out} of the tool")),
            ("way to kind I", way(near, "actuator_distance", f"{into} of the actuators")),
        ]
    console().print(facts(rows))


def way(near: xarray.Dataset, name: str, of: str) -> str:
    """Return in words how far a singular configuration is to first order."""
    distance = float(near[name])
    size = 1.0 if of.startswith("rad") else near.attrs["characteristic_length"]
    if distance > FAR * size:
        return "none to first order: its determinant has no slope here"
    return f"{distance:.4g} {of}, to first order"


def workspace(
    source: Source, joints: str | None, tool: str | None, asked: Map, as_json: bool
) -> None:
    """Print what a map of the workspace holds; write and draw it."""
    # What is asked for fits before anything is computed.
    asked.check()
    robot = made(source)
    limits = None if asked.limits is None else ranges(robot, asked.limits)
    rates, forces = (
        None if text is None else spread(robot, text, option)
        for text, option in ((asked.rates, "--rates"), (asked.forces, "--forces"))
    )
    with patience("mapping the workspace"):
        guess = configuration(robot, joints, tool)
        mapped = analysis.workspace(
            robot, axes(robot, asked.grid), guess=guess, limits=limits, rates=rates, forces=forces
        )
    written = files_of(mapped, asked)
    if as_json:
        told = (str(name) for name in mapped if name not in ("reachable", "actuator_position"))
        quantities = {name: range_of(mapped, name) for name in told}
        show_json(
            {"message": mapped.attrs["message"], "quantities": quantities, "written": written}
        )
        return
    # The spread of each quantity, and the largest ball without holes.
    rows = [("reached", str(mapped.attrs["message"]))]
    rows += [
        (str(label), spread_of(mapped, str(label)))
        for label in mapped
        if label not in ("reachable", "actuator_position")
    ]
    rows += (
        [("inscribed", ball(mapped))]
        if bool(mapped.reachable.any()) and len(mapped.reachable.dims) > 1
        else []
    )
    console().print(facts(rows))
    for file in written:
        console().print(f"{file} written", soft_wrap=True)


def files_of(mapped: xarray.Dataset, asked: Map) -> list[Path]:
    """Write a map as a file and as a picture, as far as that is asked for; return the files."""
    if asked.out is not None:
        mapped.to_netcdf(asked.out, engine="scipy")
    if asked.picture is not None:
        from linkwork.views.maps import plot_workspace

        figure = plot_workspace(mapped, asked.quantity or "conditioning").get_figure(root=True)
        if figure is not None:
            figure.savefig(asked.picture)
    return [file for file in (asked.out, asked.picture) if file is not None]


def linearise(
    source: Source, joints: str | None, tool: str | None, forces: str | None, as_json: bool
) -> None:
    """Print poles, natural modes and controllability."""
    # About the forces that hold the pose, or those given; modes only where it stays at rest.
    robot = made(source)
    with patience("linearising"):
        state = configuration(robot, joints, tool)
        held = (
            robot.holding_forces(state)
            if forces is None
            else by_name(forces, robot.actuators, "--forces")
        )
        model = analysis.linearise(robot, state, held)
        modes, still = modes_at(robot, state, held)
    if as_json:
        told = {name: getattr(model, name) for name in LINEAR_TOLD}
        own = {} if modes is None else {name: getattr(modes, name) for name in NATURAL_TOLD}
        show_json({"joints": joints_told(robot, state)} | told | {"modes": own or None})
        return
    # The state, and how it is held.
    out = console()
    out.print(
        facts(
            [
                ("configuration", pose_of(robot, state)),
                ("states", f"{len(model.states)}: {', '.join(model.states)}"),
                ("controllable", "yes" if model.controllable else "no"),
                ("equilibrium", still),
            ]
        )
    )
    out.print()
    # Poles of x' = A x.
    poles = [
        (f"{pole.real:.6g}", f"{pole.imag:+.6g}", f"{abs(pole) / (2 * np.pi):.6g}")
        for pole in model.poles
    ]
    out.print(
        table(("pole, real [1/s]", "imaginary [rad/s]", "size [Hz]"), poles, numbers=(0, 1, 2))
    )
    # Shapes scaled so that the largest part of each is 1.
    if modes is not None:
        shown = robot.independent[:FEW]
        shapes = modes.shapes[: len(shown)] / np.abs(modes.shapes).max(axis=0)
        rows = [
            (f"{frequency:.6g}", *(f"{round(value, 4) + 0.0:.4f}" for value in shape))
            for frequency, shape in zip(modes.frequencies, shapes.T, strict=True)
        ]
        out.print()
        out.print(table(("frequency [Hz]", *shown), rows, numbers=range(len(shown) + 1)))
        if (modes.frequencies < 0).any():
            out.print("\nA frequency f below zero: the robot falls away, as exp(2 pi |f| t).")
        if free := np.count_nonzero(modes.frequencies == 0):
            out.print(
                f"\nNothing pulls back {amount(int(free), 'mode')} of 0 Hz: their shapes are some "
                "of many, and so are those of other equal frequencies.",
            )


def stiffness(
    source: Source, joints: str | None, tool: str | None, given: str, as_json: bool
) -> None:
    """Print the stiffness at the tool."""
    robot = made(source)
    state = configuration(robot, joints, tool)
    named = by_name(given, robot.rates, "--joint-stiffness") if "=" in given else None
    if named is None:
        raise LinkworkError(
            "--joint-stiffness: give name=value for each stiff joint, such as "
            "'slide_1=1e5,slide_2=1e5'"
        )
    with patience("finding the stiffness"):
        K, _ = analysis.tool_stiffness(robot, state, named)
    labels = ("rx", "ry", "rz", "x", "y", "z")
    shown = pose_places(robot.planar)
    if as_json:
        names = [labels[i] for i in shown]
        told = {"components": names, "stiffness": K[np.ix_(shown, shown)]}
        show_json({"joints": joints_told(robot, state)} | told)
        return
    # Turns by the robot's own length, so that all are compared in one unit.
    weights = np.repeat([robot.equations.tree.length, 1.0], 3)
    units = np.outer(weights, weights)
    K = tidy(K, np.abs(K / units).max() * units)
    rows = [(labels[i], *(f"{K[i, j]:.4g}" for j in shown)) for i in shown]
    out = console()
    out.print(
        facts(
            [
                ("configuration", pose_of(robot, state)),
                ("units", "N/m, N/rad, N m/rad; forces by rows"),
            ]
        )
    )
    out.print()
    out.print(table(("", *(labels[i] for i in shown)), rows, numbers=range(1, len(shown) + 1)))


def equilibrium(
    source: Source,
    joints: str | None,
    tool: str | None,
    forces: str | None,
    every: bool,
    as_json: bool,
) -> None:
    """Print where a robot rests."""
    robot = made(source)
    u = None if forces is None else by_name(forces, robot.actuators, "--forces")
    with patience("looking for equilibria"):
        guess = configuration(robot, joints, tool)
        found = (
            analysis.equilibria(robot, u)
            if every
            else [analysis.equilibrium(robot, u, guess=guess)]
        )
    if not found:
        raise LinkworkError("no equilibrium is found; give other forces")
    if as_json:
        show_json([equilibrium_told(robot, one) for one in found])
        return
    # In tables, the stiffness along each rate while the others stand still.
    out = console()
    for one in found:
        energy = float(robot.energy(one.state)[1])
        stiffnesses = ", ".join(f"{value:.4g}" for value in np.diagonal(one.stiffness))
        loose = ", indifferent along some direction" if one.indifferent else ""
        out.print(
            facts(
                [
                    ("equilibrium", ("stable" if one.stable else "not stable") + loose),
                    ("at", pose_of(robot, one.state)),
                    ("stiffnesses", f"{stiffnesses}, along {', '.join(one.state.independent)}"),
                    ("energy", f"{energy:.6g} J"),
                    ("unbalanced", f"{one.residual:.2g}"),
                ]
            )
        )
        out.print()


def parameters(source: Source, effects: str | None, run: Path | None, as_json: bool) -> None:
    """Print the base parameters, described or identified."""
    # Without a run the numbers of the description are all there is.
    robot = made(source)
    wanted = () if effects is None else tuple(part.strip() for part in effects.split(","))
    out = console()
    with patience("looking for the base parameters"):
        if run is None:
            base = analysis.base_parameters(robot, wanted)
            if as_json:
                show_json(dict(zip(base.names, base.described, strict=True)))
                return
            rows = [
                (f"{value:.6g}", unit, label)
                for value, unit, label in zip(base.described, base.units, base.names, strict=True)
            ]
            heading = ("described", "unit", f"{len(base)} base parameters")
            out.print(table(heading, rows, numbers=(0,)))
            return
        found = analysis.identify(robot, Run.load(run), wanted)
    # Identified from a run.
    if as_json:
        told = {name: getattr(found, name) for name in IDENTIFIED_TOLD}
        show_json(told | {"residual": dict(zip(robot.independent, found.residual, strict=True))})
        return
    # Each beside what was described, and how far off it may be.
    base = found.base
    lines = zip(found.values, found.deviations, base.described, base.units, base.names, strict=True)
    rows = [
        (f"{value:.6g}", f"{own:.2g}", f"{told:.6g}", unit, label)
        for value, own, told, unit, label in lines
    ]
    heading = ("identified", "+-", "described", "unit", f"{len(rows)} base parameters")
    out.print(table(heading, rows, numbers=(0, 1, 2)))
    out.print()
    # What the parameters leave unexplained, by rate.
    residual = ", ".join(
        f"{label} {value:.3g}"
        for label, value in zip(robot.independent, found.residual, strict=True)
    )
    out.print(facts([("condition", f"{found.condition:.4g}"), ("remains", residual)]))


# What is typed, and what is shown


def made(source: Source) -> Robot:
    """Derive the equations of a robot."""
    with patience("deriving the equations of motion"):
        return built(source)


def configuration(robot: Robot, joints: str | None, tool: str | None) -> State:
    """Return the configuration of --joints and --tool, home where neither is given."""
    with patience("closing the loops"):
        return StartOptions(tool, joints, None).state(robot)


def spread(robot: Robot, text: str, option: str) -> float | dict[str, float]:
    """Return one number for all actuators, or one each."""
    return (
        number(text, option)
        if "=" not in text and "," not in text
        else by_name(text, robot.actuators, option)
    )


def range_of(mapped: xarray.Dataset, name: str) -> dict[str, Any]:
    """Return the least and the largest value of a quantity where it is reached, and its unit."""
    values = mapped[name].values[np.isfinite(mapped[name].values)]
    least, largest = (values.min(), values.max()) if values.size else (None, None)
    return {"from": least, "to": largest, "unit": mapped[name].attrs.get("units", "")}


def spread_of(mapped: xarray.Dataset, name: str) -> str:
    """Return the range of a quantity in words."""
    least, largest, unit = range_of(mapped, name).values()
    if least is None:
        return "none"
    return f"from {least:.4g} to {largest:.4g} {'' if unit == '1' else unit}".strip()


def ball(mapped) -> str:
    """Return the largest circle or sphere that is reached."""
    try:
        centre, radius = analysis.inscribed(mapped)
    except LinkworkError:
        return "none: an axis is an angle, or not equally spaced"
    return (
        f"radius {radius:.4g} m about "
        f"{', '.join(f'{label} {value:.4g}' for label, value in centre.items())}"
    )
