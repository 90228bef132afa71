"""The equations of motion at one state, on the command line: their terms, and forces or
accelerations."""

from __future__ import annotations

from linkwork.cli.catalogue import built
from linkwork.cli.entries import by_name
from linkwork.cli.poses import tidied
from linkwork.cli.source import Source
from linkwork.cli.start import StartOptions
from linkwork.cli.terminal import console, facts, named, patience, show_json, table
from linkwork.errors import LinkworkError


def dynamics(
    source: Source,
    start: StartOptions,
    accelerations: str | None,
    forces: str | None,
    as_json: bool,
) -> None:
    """Print M, C v, G, f, and accelerations under forces, or the forces that accelerations need."""
    # The state, and which of the two problems is asked.
    if accelerations is not None and forces is not None:
        raise LinkworkError(
            "--accelerations and --forces are both given; the ones ask for forces, the others for "
            "accelerations"
        )
    with patience("deriving the equations of motion"):
        robot = built(source)
        state = start.state(robot)
    # Forces of accelerations, or accelerations of forces; and the terms of the equations.
    v = state.independent
    if accelerations is not None:
        given = by_name(accelerations, v, "--accelerations")
        v_dot = [given.get(name, 0.0) for name in v]
        u = robot.inverse_dynamics(state, v_dot)
    else:
        u = by_name(forces, robot.actuators, "--forces") if forces is not None else {}
        v_dot = robot.forward_dynamics(state, u)
        u = [u.get(name, 0.0) for name in robot.actuators]
    terms = {
        "C v": robot.coriolis(state),
        "G": robot.gravity(state),
        "f": robot.passive_forces(state),
    }
    M = robot.mass_matrix(state)
    # As plain data, or as facts and a table by independent rates.
    if as_json:
        named_terms = {name: dict(zip(v, values, strict=True)) for name, values in terms.items()}
        found = {
            "joints": dict(zip(robot.coordinates, state.positions, strict=True)),
            "rates": dict(zip(v, state.rates, strict=True)),
            "accelerations": dict(zip(v, v_dot, strict=True)),
            "forces": dict(zip(robot.actuators, u, strict=True)),
        }
        show_json(
            found
            | {"M": {name: dict(zip(v, row, strict=True)) for name, row in zip(v, M, strict=True)}}
            | named_terms
        )
        return
    # Facts, then a row and the mass matrix by rates.
    out = console()
    rows = [
        ("joints", named(robot.coordinates, tidied(robot, state.positions))),
        ("forces", named(robot.actuators, u) or "no actuators"),
    ]
    out.print(facts(rows))
    out.print()
    columns = [state.rates, v_dot, *terms.values()]
    header = ("", "rate", "acceleration", *terms)
    lines = [(name, *(f"{column[k] + 0.0:.6g}" for column in columns)) for k, name in enumerate(v)]
    out.print(table(header, lines, numbers=range(1, len(header))))
    out.print()
    lines = [
        (name, *(f"{value + 0.0:.6g}" for value in row)) for name, row in zip(v, M, strict=True)
    ]
    out.print(table(("M", *v), lines, numbers=range(1, len(v) + 1)))
