"""Legs: maps between joints and the motors behind loops, at one state and in stacks."""

from __future__ import annotations

import numpy as np

from linkwork.analysis import ActuationModel, actuation

from benchmarks.table import Figure, Section
from benchmarks.timing import Contender, interleaved, summary
from tests.analysis.legs import ankle, floating_knee
from tests.public_legs import CALLS

METHOD = """
    `analysis.actuation` called from Python: the Jacobian J of motors by joints, its rate J', motor
    torques for joint torques, apparent inertia M and bias h with the masses of all links; at one
    state, and in a stack of 4,096 states on one core, new arrays as results. The ankle is a foot on
    a universal joint that two motors turn by cranks and rods with mass; the knee a four-bar in a
    leg under a free base. Legs of others, which are not of this repository: `python -m
    tests.public_legs FOLDER`.
    """
ONE, MANY = 1e-6, 50e-9
LEGS = {
    "ankle": lambda: actuation(ankle(), ["ankle.angle_1", "ankle.angle_2"]),
    "knee": lambda: actuation(floating_knee(), ["hip", "knee"]),
}


def run(states: int = 4096, rounds: int = 60) -> Section:
    """Time the calls of both legs."""
    contenders = {}
    for name, made in LEGS.items():
        leg = made()
        for call, contender in of_leg(leg, states).items():
            contenders[name, *call] = contender
    seconds = interleaved(contenders, rounds)
    figures = [
        Figure(
            f"{name}: {call}, {'one state' if count == 1 else f'{states:,} states, each'}",
            float(np.min(found)) * (1e6 if count == 1 else 1e9),
            "µs" if count == 1 else "ns",
            ONE * 1e6 if count == 1 else MANY * 1e9,
            note=f"median {float(np.median(found)) * 1e9:.3g} ns",
        )
        for (name, call, count), found in seconds.items()
    ]
    raw = {" ".join(map(str, key)): summary(found) for key, found in seconds.items()}
    return Section("Joints and motors of legs", METHOD, figures, raw)


def of_leg(leg: ActuationModel, states: int) -> dict[tuple[str, int], Contender]:
    """Return the calls by name and by how many states they take."""
    random, home = np.random.default_rng(1), leg.robot.home
    stack = leg.robot.state(np.repeat(home.positions[None], states, axis=0))
    stack = stack.with_rates(random.normal(size=(states, len(home.independent))))
    u = random.normal(size=(states, len(leg.joints)))
    found = {}
    for name, call in CALLS.items():
        for count, state, torques in ((1, stack.at(0), u[0]), (states, stack, u)):
            found[name, count] = Contender(
                lambda call=call, state=state, torques=torques: call(leg, state, torques), count
            )
    return found
