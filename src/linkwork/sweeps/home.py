"""Home: where the runs of a study start that vary nothing of it, and what of the start varies."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import places_of
from linkwork.model import task
from linkwork.model.assembly import UnreachableError
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


def several_in_an_inertia(study: Study) -> bool:
    """Tell whether several elements of one inertia vary, so that each may be possible and all
    together not."""
    places = [where for path in study.paths for where in places_of(study.robot, path)]
    bodies = [where[:2] for where in places if "inertia" in where]
    return len(set(bodies)) < len(bodies)


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
    # Fewer joints than determine the others are led to with the member's own loops closed, if the
    # independent ones may stay where they are.
    elif study.paths and 0 < len(joints) < task.freedoms(robot) <= len(still):
        with suppress(UnreachableError):
            guess = robot.assemble(still, guess=guess)
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
    """Return where runs start if nothing of it varies.

    Raises:
        StudyError: a start out of reach, or that the robot does not have.
    """
    try:
        state = (
            posed(study, robot, {}, robot.home)
            if study.start.tool or study.start.joints
            else robot.home
        )
        if not study.start.rates:
            return state
        rates, rest = dict(study.start.rates), dict.fromkeys(robot.independent, 0.0)
        return robot.state(state.positions, rest | rates if set(rates) <= set(rest) else rates)
    except LinkworkError as error:
        raise StudyError(str(error), ("start",)) from None
