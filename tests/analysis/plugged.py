"""A leg's tree in MuJoCo beside its closed robot."""

from __future__ import annotations

import mujoco
import numpy as np

from linkwork.formats import poses

FREE = mujoco.mjtJoint.mjJNT_FREE


class Plugged:
    """A tree in MuJoCo, by a callback or a plug-in, beside its robot."""

    def __init__(self, leg, tree, folder, plugin=False):
        self.leg, self.tree, self.robot = leg, tree, leg.robot
        path = folder / "leg.xml"
        if plugin:
            library = self.tree.build_plugin(folder / "leg.so")
            mujoco.mj_loadPluginLibrary(str(library))
        self.notes = self.tree.write_mjcf(path, plugin=plugin)
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        self.callback = None if plugin else self.tree.callback(self.model)
        self.actuators = [self.model.actuator(k).name for k in range(self.model.nu)]

    def forward(self, state=None, u=0.0):
        """Evaluate MuJoCo's accelerations in a state, whose rates are in the tree's joints."""
        if state is not None:
            self.data.qpos[:] = self.qpos(state)
            self.data.qvel[:] = self.qvel(state)
        self.data.ctrl[:] = u
        self.called(mujoco.mj_forward, self.model, self.data)
        return self.data.qacc.copy()

    def called(self, function, *given):
        mujoco.set_mjcb_passive(self.callback)
        try:
            return function(*given)
        finally:
            mujoco.set_mjcb_passive(None)

    def joints(self):
        return [self.model.joint(k) for k in range(self.model.njnt)]

    def qpos(self, state):
        found = np.zeros(self.model.nq)
        for joint in self.joints():
            at = int(joint.qposadr[0])
            if joint.type[0] == FREE:
                p, R = self.robot.body_poses(state)[self.model.body(joint.bodyid[0]).name]
                found[at : at + 7] = *p, *poses.to_quaternion(R)
            else:
                found[at] = state[joint.name]
        return found

    def qvel(self, state):
        """Return MuJoCo's rates."""
        found = np.zeros(self.model.nv)
        twists = dict(zip(self.robot.bodies, self.robot.twists(state), strict=True))
        rates = dict(zip(self.robot.rates, self.robot.joint_rates(state), strict=True))
        for joint in self.joints():
            at = int(joint.dofadr[0])
            if joint.type[0] == FREE:
                name = self.model.body(joint.bodyid[0]).name
                R, centre = self.robot.body_poses(state)[name][1], self.robot.mechanism.bodies[name]
                omega, v = twists[name][:3], twists[name][3:]
                found[at : at + 3] = v - np.cross(omega, R @ centre.centre_of_mass)
                found[at + 3 : at + 6] = R.T @ omega
            else:
                found[at] = rates[joint.name]
        return found

    def states(self, count, seed=1, spread=0.25):
        """Yield states about home, with rates of all independent joints; bases stand anywhere."""
        random, home = np.random.default_rng(seed), self.robot.home
        single = [joint.name for joint in self.joints() if joint.type[0] != FREE]
        bases = [joint.name for joint in self.joints() if joint.type[0] == FREE]
        for _ in range(count):
            state = self.robot.assemble(
                {name: float(home[name]) + random.uniform(-spread, spread) for name in single}
            )
            for base in bases:
                turn = random.normal(size=4)
                place = [*random.normal(size=3), *turn / np.linalg.norm(turn)]
                parts = ("x", "y", "z", "qw", "qx", "qy", "qz")
                moved = dict(zip(self.robot.coordinates, state.positions.tolist(), strict=True))
                moved |= {f"{base}.{part}": value for part, value in zip(parts, place, strict=True)}
                state = self.robot.state([moved[name] for name in self.robot.coordinates])
            yield self.unspun(state, random)

    def unspun(self, state, random):
        """Return a state with rates, but without angular momentum of rods about themselves."""
        state = self.robot.in_chart(state, self.leg.chart.independent)
        names, v = state.independent, random.normal(size=len(state.independent))
        spins = [names.index(name) for name in self.tree.tree.spins]
        if spins:
            M = self.robot.mass_matrix(state)
            v[spins] = 0.0
            v[spins] = -np.linalg.solve(M[np.ix_(spins, spins)], M[spins] @ v)
        return state.with_rates(v)

    def closed(self, state, u):
        """Return MuJoCo's accelerations as the closed robot has them."""
        forces = dict(zip(self.actuators, u, strict=True))
        a = self.robot.forward_dynamics(state, forces)
        all_a = dict(zip(self.robot.rates, self.robot.joint_accelerations(state, a), strict=True))
        found = np.zeros(self.model.nv)
        for joint in self.joints():
            at = int(joint.dofadr[0])
            if joint.type[0] == FREE:
                found[at : at + 6] = base_acceleration(self.robot, joint.name, state, all_a)
            else:
                found[at] = all_a[joint.name]
        return found


def base_acceleration(robot, name, state, a):
    """Return the acceleration of a free body's origin, in the ground, and R' alpha, from those of
    its joint: F2 sits at c in the body, F1 in ground."""
    near, far = (poses.of_frame(frame) for frame in robot.mechanism.joints[name].frames)
    body = robot.mechanism.joints[name].connects[1]
    R = robot.body_poses(state)[body][1]
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    omega = near[:3, :3] @ [rates[f"{name}.w{axis}"] for axis in "xyz"]
    alpha = near[:3, :3] @ [a[f"{name}.w{axis}"] for axis in "xyz"]
    there = near[:3, :3] @ [a[f"{name}.{axis}"] for axis in "xyz"]
    arm = R @ -far[:3, 3]  # from F2 to the body's origin
    origin = there + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
    return [*origin, *(R.T @ alpha)]
