"""Home: where the runs of a study start that vary nothing of it, and what of the start varies."""

from __future__ import annotations

from collections.abc import Mapping

from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.model import task
from linkwork.model.assembly import UnreachableError
from linkwork.model.posing import independent_rates
from linkwork.robot import Robot, State
from linkwork.sweeps.study import Study, StudyError

UNREACHABLE, REFUSED = -1, -2
TOOL, JOINTS, RATES = "start.tool.", "start.joints.", "start.rates."


def same_start(study: Study, robot: Robot) -> bool:
    """Tell whether all members start at the same coordinates: nothing that varies is part of the
    loops or of the start."""
    if any(name.startswith((TOOL, JOINTS)) for name in study.varied):
        return False
    function = functions.assembly(robot.equations)
    outputs = [
        "phi",
        *(("position", "orientation") if study.start.tool else ()),
        *(("coordinates",) if study.start.joints else ()),
    ]
    p = function.index_in("p")
    return not any(function.jac_sparsity(function.index_out(name), p).nnz() for name in outputs)


def posed(study: Study, robot: Robot, values: Mapping[str, float], near: State) -> State:
    """Return where a member starts, at rest; near: a state on its branch."""
    pose, joints = study.start.tool, dict(study.start.joints)
    joints |= {
        name.removeprefix(JOINTS): value
        for name, value in values.items()
        if name.startswith(JOINTS)
    }
    guess = State.known(near.positions, near.rates, near.q, robot.coordinates, robot.independent)
    still = {name: float(near[name]) for name in robot.independent if name in robot.coordinates}
    if not joints and pose is None:
        joints = still
    # Fewer joints than determine the others are led to with the member's own loops closed: where
    # the independent ones stay, or else by the least of movements.
    elif study.paths and 0 < len(joints) < task.freedoms(robot):
        try:
            guess = robot.assemble(still, guess=guess)
        except UnreachableError:
            guess = robot.assemble({}, guess=guess)
    if joints:
        guess = robot.assemble(joints, guess=guess)
    if pose is None:
        return guess
    names = task.asked_of(robot, len(pose)).labels
    return robot.assemble(
        tool=[values.get(f"{TOOL}{name}", given) for name, given in zip(names, pose, strict=True)],
        guess=guess,
    )


def home(study: Study, robot: Robot) -> State:
    """Return where runs start if nothing of it varies, at rest.

    Raises:
        StudyError: a start out of reach, or that the robot does not have.
    """
    if not (study.start.tool or study.start.joints):
        return robot.home
    try:
        return posed(study, robot, {}, robot.home)
    except LinkworkError as error:
        raise StudyError(str(error), ("start",)) from None


def begun(study: Study, robot: Robot, state: State) -> State:
    """Return a state with the rates that the study starts with.

    Raises:
        StudyError: rates that the robot does not have, or that do not determine its motion there.
    """
    if not study.start.rates:
        return state
    try:
        return state.with_rates(independent_rates(robot, dict(study.start.rates), state.q))
    except LinkworkError as error:
        raise StudyError(str(error), ("start",)) from None


def rates_given(study: Study, robot: Robot) -> tuple[str, ...]:
    """Return the names of the rates that the start gives: the independent ones, of which it may
    leave some out, or as many others."""
    own = set(study.start.rates) <= set(robot.independent)
    return robot.independent if own else tuple(study.start.rates)
