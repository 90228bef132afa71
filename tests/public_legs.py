"""Actuation through the loops of public legs, in their own files, which are not of this repository.

    python -m tests.public_legs FOLDER [--only WORDS] [--trees]

FOLDER holds clones, each named owner+name. Of each leg: J by differences of the motors' coordinates
along each joint, the same power on both sides, inertia with the robot's own kinetic energy, bias
and inertia with its own accelerations, limits and gains by their definitions; times from Python at
one state [us] and in stacks [ns a state], of two legs together and of the first alone. With --trees
the leg's tree in MuJoCo, by the callback and by the plug-in in C, beside the closed robot's
accelerations.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import linkwork as lw
from linkwork import LinkworkError, analysis
from linkwork.analysis.plugged_tree import PluggedTree

EXAMPLES = "Gepetto+example-parallel-robots/robots"
KANGAROO = "pal-robotics+pal_mjlab/src/pal_mjlab/robots/pal_kangaroo/xmls"
STACK, NEAR = 4096, 0.03
KINDS = ("callback", "plug-in in C")


@dataclass(frozen=True)
class PublicLeg:
    """Name joints and motors of a leg in a file, and where its joints stand; of so many legs, one
    after the other."""

    name: str
    file: str
    joints: tuple[str, ...]
    motors: tuple[str, ...] | None = None
    reference: dict[str, float] = field(default_factory=dict)
    legs: int = 1

    @property
    def first(self) -> PublicLeg:
        """The first of its legs alone, of the same robot."""
        joints, motors = self.joints, self.motors or ()
        count = len(joints) // self.legs
        return replace(self, joints=joints[:count], motors=motors[:count] or None, legs=1)


def of_both(ends: tuple[str, str], *names: str) -> tuple[str, ...]:
    """Return names with the ends of both sides, or what stands before them."""
    return tuple(end + name if end.endswith("-") else name + end for end in ends for name in names)


CASSIE, SIDES = "osudrl+cassie-mujoco-sim/model/cassie.xml", ("left-", "right-")
STANDING = {
    side + joint: angle
    for side in SIDES
    for joint, angle in (
        ("hip-pitch", 0.5),
        ("knee", -1.2),
        ("tarsus", 1.4267),
        ("foot-crank", -1.5244),
        ("plantar-rod", 1.5244),
        ("foot", -1.5968),
    )
}
BENT = {
    f"leg_{side}_{joint}_joint": angle
    for side in ("left", "right")
    for joint, angle in (("length", -0.171), ("femur", -0.227), ("knee", -0.454))
}
LEGS = (
    PublicLeg(
        "battobot, both legs",
        f"{EXAMPLES}/battobot_6d/robot.urdf",
        of_both(("_left", "_right"), "knee", "ankley", "anklex"),
        of_both(("_left", "_right"), "motor_knee", "motor_ankle1", "motor_ankle2"),
        legs=2,
    ),
    PublicLeg(
        "digit-like",
        f"{EXAMPLES}/digit_like/robot.urdf",
        ("free_knee", "free_foot1", "free_foot2"),
        ("motor_knee", "motor_shin1", "motor_shin2"),
    ),
    PublicLeg(
        "digit-like, both legs",
        f"{EXAMPLES}/digit_like_2legs/robot.urdf",
        of_both(("", "_left"), "motor_hip_y", "free_knee", "free_foot1", "free_foot2"),
        of_both(("", "_left"), "motor_hip_y", "motor_knee", "motor_shin1", "motor_shin2"),
        legs=2,
    ),
    PublicLeg(
        "digit-like, six rows",
        f"{EXAMPLES}/digit_like_2legs_6D/robot.urdf",
        of_both(("", "_left"), "motor_hip_y", "free_knee", "free_foot1", "free_foot2"),
        of_both(("", "_left"), "motor_hip_y", "motor_knee", "motor_shin1", "motor_shin2"),
        legs=2,
    ),
    PublicLeg(
        "cassie-like",
        f"{EXAMPLES}/cassie_like/robot.urdf",
        ("free_knee", "free_ankle"),
        ("motor_knee", "motor_ankle"),
    ),
    PublicLeg(
        "talos-like ankle", f"{EXAMPLES}/talos_like/robot.urdf", ("free_ankle",), ("motor_shin",)
    ),
    PublicLeg(
        "talos, both ankles",
        f"{EXAMPLES}/true_talos_2_legs/talos_full_v2.urdf",
        ("leg_left_5_joint", "leg_right_5_joint"),
        ("leg_left_shin_joint", "leg_right_shin_joint"),
        legs=2,
    ),
    PublicLeg(
        "disney-like",
        f"{EXAMPLES}/disney_like/robot.urdf",
        (
            "motor_hip_x",
            "motor_4barlink3",
            "free_4barlink5",
            "free_universal1",
            "free_universal2",
            "motor_ankle",
            "free_universal4",
        ),
        (
            "motor_hip_x",
            "motor_4barlink3",
            "motor_4barlink1",
            "motor_4barlink2",
            "motor_4barlink4",
            "motor_ankle",
            "free_universal4",
        ),
    ),
    PublicLeg(
        "kangaroo, both legs",
        f"{KANGAROO}/kangaroo_lower_body.xml",
        ("leg_left_length_joint", "leg_right_length_joint"),
        ("leg_left_femur_joint", "leg_right_femur_joint"),
        BENT,
        legs=2,
    ),
    PublicLeg(
        "cassie's feet",
        CASSIE,
        ("left-foot", "right-foot"),
        ("left-foot-crank", "right-foot-crank"),
        STANDING,
        legs=2,
    ),
    PublicLeg(
        "cassie, both legs",
        CASSIE,
        of_both(SIDES, "knee", "shin", "tarsus", "foot"),
        of_both(SIDES, "knee", "heel-spring", "tarsus", "foot"),
        STANDING,
        legs=2,
    ),
    PublicLeg(
        "toddlerbot's knees",
        "hshi74+toddlerbot/toddlerbot/descriptions/toddlerbot/toddlerbot.xml",
        ("left_knee", "right_knee"),
        ("left_knee_act", "right_knee_act"),
        legs=2,
    ),
    PublicLeg(
        "planar leg of generalized_rbda",
        "ROAM-Lab-ND+generalized_rbda/robot-models/planar_leg_linkage.urdf",
        ("base_to_thigh", "thigh_to_support"),
        ("base_to_thigh", "thigh_to_driver"),
    ),
    PublicLeg(
        "five-bar leg",
        f"{EXAMPLES}/5bar_linkage_iso6d/robot.urdf",
        ("mot1", "free1"),
        ("mot1", "mot2"),
    ),
)


CALLS = {
    "J": lambda leg, state, u: leg.jacobian(state),
    "J'": lambda leg, state, u: leg.jacobian_rate(state),
    "torques": lambda leg, state, u: leg.motor_torques(state, u),
    "M": lambda leg, state, u: leg.inertia(state),
    "h": lambda leg, state, u: leg.bias(state),
}


def read(leg: PublicLeg, folder: Path) -> analysis.ActuationModel:
    """Return the model of a leg, whose robot is driven by all its motors, by forces."""
    robot = lw.Robot.from_file(folder / leg.file, reference=leg.reference or None)
    driven = tuple(dict.fromkeys((*robot.actuators, *(leg.motors or ()))))
    mechanism = robot.mechanism.model_copy(update={"actuators": driven, "drives": {}})
    robot = lw.Robot(mechanism)
    return analysis.actuation(robot, leg.joints, leg.motors)


def errors(leg: analysis.ActuationModel, seed: int = 0) -> dict[str, float]:
    """Return how far each part is from what it has to be, over its own size, at a state near
    home."""
    random, k, robot = np.random.default_rng(seed), len(leg.joints), leg.robot
    home = np.array([float(robot.home[name]) for name in leg.joints])
    x = home + random.uniform(-NEAR, NEAR, k)
    state = leg.at(x)
    J, step = leg.jacobian(state), 1e-4
    found = {}
    # J along each joint by differences of fourth order.
    columns = []
    for unit in np.eye(k):
        at = [leg.coordinates(leg.at(x + n * step * unit, guess=state)) for n in (-2, -1, 1, 2)]
        columns.append((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step))
    found["J"] = apart(np.transpose(columns), J)
    # The same power on both sides; in the joints' rates alone the energy of the robot.
    w, u = random.normal(size=(2, k))
    power = leg.joint_torques(state, u) @ w - u @ leg.motor_rates(state, w)
    found["power"] = abs(power) / np.linalg.norm(u) / np.linalg.norm(J @ w)
    names = leg.chart.independent
    moving = robot.in_chart(state, names)
    v = np.zeros(len(names))
    v[[names.index(name) for name in leg.joints]] = w
    v = dict(zip(names, v.tolist(), strict=True))
    moving = moving.with_rates([v[name] for name in moving.independent])
    found["M"] = apart(w @ leg.inertia(state) @ w / 2, robot.energy(moving)[0])
    # Torques of all motors, and what the joints then do.
    given = dict(zip(leg.motors, u, strict=True))
    a = robot.joint_accelerations(moving, robot.forward_dynamics(moving, given))
    a = dict(zip(robot.rates, a, strict=True))
    whole = robot.mass_matrix(moving)
    rows = [moving.independent.index(name) for name in leg.joints]
    needed = whole[rows] @ [a[name] for name in moving.independent] + leg.bias(moving)
    found["h"] = apart(needed, leg.joint_torques(state, u))
    # Limits by all corners; gains there and back.
    signs = np.array(np.meshgrid(*[[-1, 1]] * k)).reshape(k, -1).T
    V = random.uniform(1, 2, k)
    reached = np.abs(leg.joint_rates(leg.robot.state([state.positions] * len(signs)), signs * V))
    found["limits"] = apart(reached.max(axis=0), leg.speed_limits(state, V).most)
    gains = leg.joint_gains(state, V, V / 9, torques=u)
    back = leg.motor_gains(state, gains.kp, gains.kd, torques=u)
    found["gains"] = max(apart(back.kp, np.diag(V)), apart(back.kd, np.diag(V / 9)))
    return found


def apart(found: np.ndarray | float, wanted: np.ndarray | float) -> float:
    """Return the greatest difference over the greatest number."""
    return float(np.max(np.abs(np.subtract(found, wanted))) / np.max(np.abs(wanted)))


def of_tree(leg: analysis.ActuationModel) -> str:
    """Return how far the tree's accelerations in MuJoCo are from the closed robot's, or why there
    is no tree."""
    try:
        tree = leg.tree()
    except LinkworkError as refused:
        return str(refused)
    found = {kind: of_engine(leg, tree, kind == "plug-in in C") for kind in KINDS}
    return ", ".join(f"{kind} {error:.0e}" for kind, error in found.items())


def of_engine(leg: analysis.ActuationModel, tree: PluggedTree, plugin: bool) -> float:
    """Return how far the tree's accelerations are from the closed robot's, over the largest, in
    four states near home."""
    import mujoco

    from tests.analysis.plugged import Plugged

    with tempfile.TemporaryDirectory() as folder:
        engine = Plugged(leg, tree, Path(folder), plugin)
    engine.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    random, worst = np.random.default_rng(3), 0.0
    for state in engine.states(4, spread=NEAR):
        u = random.normal(size=engine.model.nu)
        worst = max(worst, apart(engine.forward(state, u), engine.closed(state, u)))
    return worst


def times(leg: analysis.ActuationModel) -> tuple[list[float], list[float]]:
    """Return times at one state [us] and in a stack [ns a state] of the calls."""
    random, k, robot = np.random.default_rng(1), len(leg.joints), leg.robot
    home = robot.home
    states = robot.state(np.repeat(home.positions[None], STACK, axis=0))
    states = states.with_rates(random.normal(size=(STACK, len(home.independent))))
    one, u = states.at(0), random.normal(size=(STACK, k))
    first = u[0]
    return (
        [1e6 * best(lambda call=call: call(leg, one, first), 500) for call in CALLS.values()],
        [1e9 * best(lambda call=call: call(leg, states, u), 1) / STACK for call in CALLS.values()],
    )


def shown_times(leg: analysis.ActuationModel) -> str:
    """Return the times of a leg in a line."""
    single, stacked = times(leg)
    return (
        " ".join(f"{value:.2f}" for value in single)
        + " us | "
        + " ".join(f"{value:.0f}" for value in stacked)
        + " ns"
    )


def best(call, count: int, rounds: int = 40) -> float:
    """Return the least time of a call [s]."""
    call()
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(count):
            call()
        found.append(time.perf_counter() - start)
    return min(found) / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--trees", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print("times:", ", ".join(CALLS), "at one state [us]; in stacks [ns a state]")
    for leg in LEGS:
        if given.only and not any(word in leg.name for word in given.only):
            continue
        if not (given.folder / leg.file).exists():
            print(f"{leg.name}: not looked at, for {leg.file} is not there")
            continue
        model = read(leg, given.folder)
        found = errors(model)
        parts = " ".join(f"{name} {error:.0e}" for name, error in found.items())
        print(f"{leg.name}: {len(leg.joints)} of {model.robot.mobility} freedoms | {parts}")
        print("   ", shown_times(model), flush=True)
        if leg.legs > 1:
            print("    one leg:", shown_times(read(leg.first, given.folder)), flush=True)
        if given.trees:
            print("    tree:", of_tree(model), flush=True)


if __name__ == "__main__":
    main()
