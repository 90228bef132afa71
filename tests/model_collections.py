"""Model files of others, a folder at a time: what is read, how it moves beside another engine, and
whether a second of it runs.

    python -m tests.model_collections FOLDER [--only WORDS] [--seconds 1] [--limit 150] [--out FILE]

Each file is read in a process of its own. MuJoCo or Pinocchio read it too, and both move freely
from one state for some microseconds, theirs by its own mass matrix, forces and exact constraints:

    M a + J' lambda = f,   J a = -J' v      (dJ/dt v by differences of eighth order, RK4)

The column `apart` is the greatest difference of the twists of bodies of one name then, over their
greatest change: of accelerations, in sum. Of times from ten microseconds down to a tenth of a
nanosecond the best one counts, for stiff models need the shorter and rounding the longer. A file
counts as right where that is below 1e-8, or where the mechanism has caveats: sentences on what was
left out, or what rounded numbers leave open in it.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.formats.models import FORMATS, MODELS, read
from linkwork.formats.reading import Reading

SPANS, STEPS = (
    (1e-5, 1e-7, 1e-8, 1e-10),
    4,
)  # of the motion beside the other engine [s], and of its integrator
RIGHT = 1e-8  # of which rounding within so short a time takes up to a half
LEAST = 0.1  # of accelerations that differences are compared with [m/s^2, rad/s^2]
ROUNDED = 1e-6  # rows so much shorter than the longest are what rounded numbers leave of none
RANK = 1e-7  # of constraint rows, relative to the greatest
AHEAD = 2e-2  # of the motion on which differences are taken
EIGHTH = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # order of them
COLUMNS = ("file", "read", "caveats", "mobility", "other", "apart", "run", "end", "closure", "cpu")


class MuJoCoSide:
    """A model as MuJoCo reads it, without contacts, limits, actuators and its own dry friction, and
    without what is of files that are not there or no meshes."""

    def __init__(self, path: Path):
        import mujoco as mj

        try:
            model = mj.MjModel.from_xml_path(str(path))
        except ValueError as error:
            if not any(words in str(error) for words in ("opening file", "decoder")):
                raise
            try:
                model = without(mj.MjSpec.from_file(str(path)), meshes=False).compile()
            except ValueError:
                model = without(mj.MjSpec.from_file(str(path)), meshes=True).compile()
        self.mj, self.model = mj, model
        off = ("CONTACT", "LIMIT", "FRICTIONLOSS", "ACTUATION")
        for word in off:
            self.model.opt.disableflags |= int(getattr(mj.mjtDisableBit, f"mjDSBL_{word}"))
        self.model.jnt_actgravcomp[:] = 0
        self.model.opt.jacobian = mj.mjtJacobian.mjJAC_DENSE
        self.data = mj.MjData(self.model)
        self.nv, self.start = self.model.nv, self.model.qpos0.copy()
        self.bodies = {
            (self.model.body(k).name or f"body_{k}").replace(".", "_"): k
            for k in range(1, self.model.nbody)
        }

    def stepped(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        q = q.copy()
        self.mj.mj_integratePos(self.model, q, dq, 1.0)
        return q

    def _at(self, q: np.ndarray, v: np.ndarray) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, v

    def pose(self, q: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, rotation and Jacobian (linear, then angular) of a body."""
        self._at(q, np.zeros(self.nv))
        self.mj.mj_kinematics(self.model, self.data)
        self.mj.mj_comPos(self.model, self.data)
        J, k = np.zeros((6, self.nv)), self.bodies[name]
        self.mj.mj_jacBody(self.model, self.data, J[:3], J[3:], k)
        return self.data.xpos[k].copy(), self.data.xmat[k].reshape(3, 3).copy(), J

    def rows(self, q: np.ndarray) -> np.ndarray:
        self._at(q, np.zeros(self.nv))
        self.mj.mj_fwdPosition(self.model, self.data)
        J, count = np.array(self.data.efc_J).reshape(-1, self.nv), self.data.nefc
        equality = int(self.mj.mjtConstraint.mjCNSTR_EQUALITY)
        return J[:count][np.array(self.data.efc_type)[:count] == equality]

    def dynamics(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._at(q, v)
        self.mj.mj_forward(self.model, self.data)
        M = np.zeros((self.nv, self.nv))
        self.mj.mj_fullM(self.model, self.data, M)
        dry = self.model.dof_frictionloss * v / np.hypot(v, 0.01)
        return M, self.data.qfrc_passive - self.data.qfrc_bias - dry


def without(spec: Any, meshes: bool) -> Any:
    """Return a model of MuJoCo without pictures and skins, and without meshes whose files are not
    there, or without all that is of files."""
    import mujoco as mj

    folder = Path(spec.modelfiledir) / (spec.compiler.meshdir or "")
    gone = [mesh for mesh in spec.meshes if meshes or not (folder / (mesh.file or "")).exists()]
    names = {mesh.name or Path(mesh.file).stem for mesh in gone}
    needing = (mj.mjtGeom.mjGEOM_MESH, mj.mjtGeom.mjGEOM_SDF, mj.mjtGeom.mjGEOM_HFIELD)
    for part in [*spec.pairs, *spec.excludes, *spec.sensors]:
        spec.delete(part)
    for geom in list(spec.geoms):
        geom.material = ""
        if geom.meshname in names or (meshes and geom.type in needing):
            spec.delete(geom)
    for site in (*spec.sites, *spec.tendons):
        site.material = ""
    drawn = [*spec.skins, *spec.materials, *spec.textures]
    for part in [*drawn, *gone, *(spec.hfields if meshes else ())]:
        spec.delete(part)
    return spec


class PinocchioSide:
    """A tree as Pinocchio reads it; loops of conventions beside URDF are not known to it."""

    def __init__(self, path: Path):
        import pinocchio as pin

        self.pin, self.model = pin, pin.buildModelFromUrdf(str(path))
        self.data, self.nv = self.model.createData(), self.model.nv
        self.start = pin.neutral(self.model)
        self.model.armature[:] = 0
        frames = ((k, frame) for k, frame in enumerate(self.model.frames))
        self.bodies = {
            frame.name.replace(".", "_"): k
            for k, frame in frames
            if frame.type == pin.FrameType.BODY
        }
        self.friction, self.damping = np.zeros(self.nv), np.zeros(self.nv)
        from linkwork.formats import xml

        self.couplings, root = [], xml.read(path)
        for element in root.each("joint"):
            self._read_joint(element)
        for element in root.each("transmission"):
            self._read_rotor(element)
        for element in root.each("coupling"):
            self._read_coupling(element)

    def _read_joint(self, element: Any) -> None:
        """Take friction and mimics, which Pinocchio's engine leaves to others, from the file."""
        name, dynamics, mimic = (
            element.attributes.get("name", ""),
            element.first("dynamics"),
            element.first("mimic"),
        )
        at = self._index(name)
        if at is None:
            return
        if dynamics is not None:
            self.damping[at] = dynamics.number("damping", 0.0)
            self.friction[at] = dynamics.number("friction", 0.0)
        other = None if mimic is None else self._index(mimic.attributes.get("joint", ""))
        if mimic is not None and other is not None:
            row = np.zeros(self.nv)
            row[at], row[other] = 1.0, -mimic.number("multiplier", 1.0)
            self.couplings.append(row)

    def _read_rotor(self, element: Any) -> None:
        """Take the inertia of a rotor behind its gear, which Drake's files have."""
        joint, actuator = element.first("joint"), element.first("actuator")
        at = None if joint is None else self._index(joint.attributes.get("name", ""))
        if at is None or actuator is None:
            return
        ratio, inertia = actuator.first("drake:gear_ratio"), actuator.first("drake:rotor_inertia")
        if ratio is not None and inertia is not None:
            own = ratio.number("value") ** 2 * inertia.number("value")
            self.model.armature[at] = own

    def _read_coupling(self, element: Any) -> None:
        """Take a gear of URDF+: ratio * (rates on the way to the predecessor) = (to the successor),
        from the nearest link that both ways have."""
        ways = []
        for end in ("predecessor", "successor"):
            frame = self.model.getFrameId(element.named(end).attributes["link"])
            joint, way = self.model.frames[frame].parentJoint, set()
            while joint > 0:
                way.add(joint)
                joint = self.model.parents[joint]
            ways.append(way)
        row, ratio = np.zeros(self.nv), element.named("ratio").number("value")
        for way, other, factor in ((*ways, ratio), (*ways[::-1], -1.0)):
            for joint in way - other:
                row[self.model.joints[joint].idx_v] = factor
        self.couplings.append(row)

    def _index(self, name: str) -> int | None:
        if not self.model.existJointName(name):
            return None
        joint = self.model.joints[self.model.getJointId(name)]
        return joint.idx_v if joint.nv == 1 else None

    def stepped(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return self.pin.integrate(self.model, q, dq)

    def pose(self, q: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        k, world = self.bodies[name], self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        X = self.data.oMf[k]
        J = self.pin.getFrameJacobian(self.model, self.data, k, world)
        return X.translation.copy(), X.rotation.copy(), J.reshape(6, self.nv).copy()

    def rows(self, q: np.ndarray) -> np.ndarray:
        return np.array(self.couplings).reshape(-1, self.nv)

    def dynamics(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        M = self.pin.crba(self.model, self.data, q)
        bias = self.pin.rnea(self.model, self.data, q, v, np.zeros(self.nv))
        return np.triu(M) + np.triu(M, 1).T, (
            -bias - self.damping * v - self.friction * v / np.hypot(v, 0.01)
        )


def fitted(side: Any, poses: dict, twists: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return the engine's q and v in which its bodies have given poses and twists."""
    q, v = side.start, np.zeros(side.nv)
    for _ in range(100):
        apart, jacobians, rates = [], [], []
        for name, (p, R) in poses.items():
            at, turn, J = side.pose(q, name)
            apart += [p - at, Rotation.from_matrix(R @ turn.T).as_rotvec()]
            jacobians.append(J)
            rates.append(twists[name])
        J = np.concatenate(jacobians)
        step = np.linalg.lstsq(J, np.concatenate(apart), rcond=1e-9)[0]
        v = np.linalg.lstsq(J, np.concatenate(rates), rcond=1e-9)[0]
        if np.linalg.norm(step) < 1e-13:
            break
        q = side.stepped(q, step)
    return q, v


def acceleration(side: Any, q: np.ndarray, v: np.ndarray, freedoms: int) -> np.ndarray:
    """Return a of  M a + J' lambda = f,  J a = -dJ/dt v,  rows of J that depend on others apart:
    so many that the freedoms are left, where rounded numbers make them independent."""
    M, f = side.dynamics(q, v)
    J = side.rows(q)
    if not len(J):
        return np.linalg.solve(M, f)
    # Over a wide step, for a row that is nearly lost divides what rounding leaves of differences.
    h = AHEAD / max(1.0, float(np.max(abs(v))))
    gamma = np.zeros(len(J))
    for k, weight in EIGHTH.items():
        ahead, behind = (side.rows(side.stepped(q, way * k * h * v)) @ v for way in (1, -1))
        gamma += weight * (ahead - behind) / h
    # In coordinates of like inertia, and rows of like size.
    d = 1 / np.sqrt(np.diag(M))
    scaled = J * d
    size = np.linalg.norm(scaled, axis=1)
    own = np.linalg.norm(J, axis=1)
    size[own < ROUNDED * own.max(initial=1e-300)] = 1.0
    U, s, Vt = np.linalg.svd(scaled / size[:, None])
    rank = min(int((s > RANK * s[0]).sum()), side.nv - freedoms)
    N, held = Vt[rank:].T, -Vt[:rank].T @ ((U.T @ (gamma / size))[:rank] / s[:rank])
    inertia = M * d * d[:, None]
    free = np.linalg.solve(N.T @ inertia @ N, N.T @ (f * d - inertia @ held))
    return d * (held + N @ free)


def moved(
    side: Any, q: np.ndarray, v: np.ndarray, freedoms: int, span: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return q and v after a time, by the method of Runge and Kutta."""
    h = span / STEPS
    for _ in range(STEPS):
        slopes = [(v, acceleration(side, q, v, freedoms))]
        for part in (h / 2, h / 2, h):
            w, a = slopes[-1]
            there = side.stepped(q, part * w), v + part * a
            slopes.append((there[1], acceleration(side, *there, freedoms)))
        weights = (1, 2, 2, 1)
        q = side.stepped(q, h / 6 * sum(k * w for k, (w, _) in zip(weights, slopes, strict=True)))
        v = v + h / 6 * sum(k * a for k, (_, a) in zip(weights, slopes, strict=True))
    return q, v


def twists_of(robot: lw.Robot, state: lw.State) -> dict[str, np.ndarray]:
    """Return velocity of the origin and angular velocity of each body, by name."""
    found = {}
    poses = robot.body_poses(state)
    for name, twist in zip(robot.bodies, robot.twists(state), strict=True):
        omega, velocity = twist[:3], twist[3:]
        centre = poses[name][1] @ np.array(robot.mechanism.bodies[name].centre_of_mass)
        found[name] = np.concatenate([velocity - np.cross(omega, centre), omega])
    return found


def apart(robot: lw.Robot, side: Any) -> float:
    """Return how far the accelerations of a robot and of the other engine's model are apart."""
    rates = 0.3 * np.random.default_rng(7).normal(size=robot.mobility)
    state = robot.home.with_rates(rates)
    poses = {name: X for name, X in robot.body_poses(state).items() if name in side.bodies}
    before = twists_of(robot, state)
    q, v = fitted(side, poses, before)
    start = {name: side.pose(q, name)[2] @ v for name in poses}
    found = []
    for span in SPANS:
        try:
            q_end, v_end = moved(side, q, v, robot.mobility, span)
        except np.linalg.LinAlgError:  # so stiff that their method leaves all numbers
            continue
        run = robot.simulate(state, duration=span, rtol=1e-12, atol=1e-13)
        after = twists_of(robot, run.final)
        # Changes of twists, which leave out what the fit of the start has left.
        changes = {name: side.pose(q_end, name)[2] @ v_end - start[name] for name in poses}
        differ = [changes[name] - (after[name] - before[name]) for name in poses]
        most = max(float(np.max(abs(change))) for change in changes.values())
        found.append(max(float(np.max(abs(each))) for each in differ) / max(most, LEAST * span))
    return float(np.fmin.reduce(found))


def as_seen(robot: lw.Robot, side: Any) -> lw.Robot:
    """Return a robot without what the other engine has not here: ends of transmissions, and for
    Pinocchio what carries weights of links (Gazebo's words, which it does not read)."""
    mechanism = robot.mechanism
    if mechanism.lifts and isinstance(side, PinocchioSide):
        mechanism = mechanism.model_copy(update={"lifts": {}})
        robot = lw.Robot(mechanism)
    lines = mechanism.transmissions
    free = {
        name: line.model_copy(update={"stop": None})
        for name, line in lines.items()
        if getattr(line, "stop", None)
    }
    if not free:
        return robot
    return lw.Robot(mechanism.model_copy(update={"transmissions": {**lines, **free}}))


def row_of(path: Path, seconds: float, root: Path) -> dict[str, Any]:
    """Return what is found of one file; root: a folder whose files it may include."""
    began = time.process_time()
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "")
    row["file"] = str(path)
    try:
        imported = read(path, Reading(includes=(root,)))
        row |= {"read": "yes", "caveats": len(imported.mechanism.caveats)}
        robot = lw.Robot(imported.mechanism)
        row["mobility"] = robot.mobility
        row["caveats"] += len(robot.equations.caveats)
    except lw.LinkworkError as refusal:
        row["read"] = row["read"] or "refused"
        row["run"] = " ".join(str(refusal).split())[-160:]
        robot = None
    try:
        side = (PinocchioSide if path.suffix == ".urdf" else MuJoCoSide)(path)
        row["other"] = "reads"
    except Exception as error:  # whatever the other engine does not take
        side, row["other"] = None, f"no: {' '.join(str(error).split())[:60]}"
    if robot is not None:
        # Pinocchio knows no loops of the conventions beside URDF.
        loops = len(robot.mechanism.pairs) > len(robot.bodies)
        if side is not None and side.bodies and not (loops and path.suffix == ".urdf"):
            try:
                row["apart"] = f"{apart(as_seen(robot, side), side):.1e}"
            except (lw.LinkworkError, ValueError, np.linalg.LinAlgError) as error:
                row["apart"] = " ".join(str(error).split())[:60]
        run = robot.simulate(robot.home, duration=seconds)
        row |= {"run": run.status.name, "end": f"{run.time[-1]:g}"}
        row["closure"] = f"{float(np.max(run['closure_error'])):.1e}"
    row["cpu"] = f"{time.process_time() - began:.1f}"
    return row


def models_in(folder: Path, only: str) -> list[Path]:
    """Return the model files of a folder, by suffix and root element."""
    roots = tuple(f"<{form.root}" for form in FORMATS)
    return [
        path
        for path in sorted(folder.rglob("*"))
        if path.suffix.lower() in MODELS
        and only in str(path)
        and any(root in path.read_text(errors="replace") for root in roots)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.model_collections")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="words that the path holds")
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--limit", type=float, default=150.0, help="seconds for one file")
    parser.add_argument("--out", type=Path, help="a CSV file for the table")
    parser.add_argument("--one", type=Path, help="a file of FOLDER alone; print its row")
    asked = parser.parse_args()
    if asked.one:
        warnings.simplefilter("ignore")
        print(json.dumps(row_of(asked.one, asked.seconds, asked.folder)))
        return
    rows = []
    for path in models_in(asked.folder, asked.only):
        command = [sys.executable, "-m", __spec__.name, str(asked.folder)]
        command += ["--one", str(path), "--seconds", str(asked.seconds)]
        row = dict.fromkeys(COLUMNS, "") | {"file": str(path)}
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=asked.limit, check=False
            )
            row = json.loads(done.stdout.splitlines()[-1])
        except subprocess.TimeoutExpired:
            row["run"] = f"longer than {asked.limit:g} s"
        except (IndexError, json.JSONDecodeError):
            row["run"] = f"crash: {done.stderr.strip().splitlines()[-1:]}"
        rows.append(row)
        print("  ".join(str(row[name])[-60:] for name in COLUMNS), flush=True)
    if asked.out:
        with asked.out.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    print(summary(rows))


def summary(rows: list[dict[str, Any]]) -> str:
    """Return how many files are read, right or warned of, and run."""
    numbers = [row for row in rows if row["apart"][:1].isdigit()]
    silent = [row for row in numbers if float(row["apart"]) > RIGHT and not row["caveats"]]
    lines = [
        f"{len(rows)} files; read: {dict(Counter(row['read'] for row in rows))}",
        f"beside another engine: {len(numbers)}, apart without a word: {len(silent)}",
        *(f"    {row['apart']}  {row['file']}" for row in silent),
        f"runs: {dict(Counter(row['run'].split(':')[0][:40] for row in rows))}",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
