"""Model files drawn at random, in which features meet: trees of MJCF, URDF, and SDF beside the MJCF
that says the same plainly."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

inverse = np.linalg.inv


def words(*numbers) -> str:
    return " ".join(repr(float(x)) for x in np.concatenate([np.ravel(each) for each in numbers]))


def pose(random: np.random.Generator, reach: float = 0.3) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = Rotation.from_rotvec(random.uniform(-2, 2, 3)).as_matrix()
    X[:3, 3] = random.uniform(-reach, reach, 3)
    return X


def tensor(random: np.random.Generator, mass: float) -> np.ndarray:
    Q = pose(random)[:3, :3]
    return Q @ np.diag(mass * np.sort(random.uniform(0.005, 0.01, 3))) @ Q.T


class Mjcf:
    """A tree of MJCF: classes, frames, orientations, masses, joints, tendons, actuators."""

    CLASSES = ("main", "one", "two", "three")

    def __init__(self, seed: int):
        self.random, self.joints, self.sites = np.random.default_rng(seed), [], []
        self.degrees = self.chance(0.5)
        self.sequence = "".join(self.random.choice(list("xyzXYZ"), 3))

    def chance(self, part: float) -> bool:
        return bool(self.random.random() < part)

    def numbers(self, count: int, low: float = -1.0, high: float = 1.0) -> str:
        return words(self.random.uniform(low, high, count))

    def angles(self, count: int) -> str:
        return words(self.random.uniform(-3, 3, count) * (57.3 if self.degrees else 1))

    def of_class(self) -> str:
        return f'class="{self.random.choice(self.CLASSES)}"' if self.chance(0.4) else ""

    def place(self) -> str:
        forms = (
            f'quat="{self.numbers(4)}"',
            f'euler="{self.angles(3)}"',
            f'axisangle="{self.numbers(3)} {self.angles(1)}"',
            f'xyaxes="{self.numbers(6)}"',
            f'zaxis="{self.numbers(3)}"',
        )
        return f'pos="{self.numbers(3, -0.3, 0.3)}" {self.random.choice(forms)}'

    def framed(self, text: str) -> str:
        return f"<frame {self.place()}>{text}</frame>" if self.chance(0.3) else text

    def settings(self) -> str:
        """Return what a class says of joints, geoms and actuators."""
        return (
            f'<joint damping="{self.numbers(1, 0)}" axis="{self.numbers(3)}" '
            f'armature="{self.numbers(1, 0, 0.05)}"/>'
            * self.chance(0.6)
            + f'<geom density="{self.numbers(1, 300, 2000)}" {self.place()} '
            f'size="{self.numbers(3, 0.03, 0.1)}"/>'
            * self.chance(0.5)
            + self.random.choice(
                [
                    f'<position kp="{self.numbers(1, 1, 9)}" kv="{self.numbers(1, 0)}"/>',
                    f'<velocity kv="{self.numbers(1, 1, 5)}"/>',
                    f'<general gainprm="{self.numbers(3, 1, 3)}" biasprm="{self.numbers(2)} -1" '
                    'biastype="affine"/>',
                    f'<motor gear="{self.numbers(2)}" ctrlrange="-1 1"/>',
                    f'<cylinder area="{self.numbers(1)}" timeconst="{self.numbers(1, 0.1)}"/>',
                    "",
                ]
            )
        )

    def joint(self) -> str:
        name, kind = f"j{len(self.joints)}", self.random.choice(["hinge", "hinge", "slide"])
        self.joints.append(name)
        scale = 57.3 if self.degrees and kind == "hinge" else 1
        spring = f'stiffness="{self.numbers(1, 0, 9)}" springref="{self.numbers(1, 0, scale)}" '
        return (
            f'<joint name="{name}" type="{kind}" pos="{self.numbers(3, -0.1, 0.1)}" '
            f'ref="{self.numbers(1, 0, scale / 2)}" {spring * self.chance(0.5)}'
            f'{self.of_class()} axis="{self.numbers(3)}"/>'
        )

    def body(self, depth: int, root: bool = False) -> str:
        kinds = ["sphere", "box", "capsule", "cylinder", "ellipsoid"]
        geoms = (
            f'<geom type="{kind}" size="{self.numbers(3, 0.03, 0.1)}" {self.place()} '
            f"{self.of_class()}/>"
            for kind in self.random.choice(kinds, self.random.integers(1, 3))
        )
        I = tensor(self.random, 1.0)  # noqa: E741
        own = words(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        mass = "".join(map(self.framed, geoms))
        if self.chance(0.4):
            mass = f'<inertial pos="{self.numbers(3, 0, 0.1)}" mass="1" fullinertia="{own}"/>'
        joints = "<joint name='free' type='free'/>"
        if not root or self.chance(0.7):
            joints = "".join(self.joint() for _ in range(self.random.integers(1, 3)))
        self.sites.append(f"s{len(self.sites)}")
        site = self.framed(f'<site name="{self.sites[-1]}" {self.place()}/>')
        child = self.framed(self.body(depth - 1)) if depth else ""
        more = f'gravcomp="{self.numbers(1, 0)}"' * self.chance(0.3)
        inside = f"{joints}{mass}{site}{child}"
        return f'<body childclass="{self.random.choice(self.CLASSES)}" {self.place()} {more}>\
{inside}</body>'

    def actuators(self) -> str:
        found = []
        for joint in self.joints[:3]:
            kind = self.random.choice(
                ["position", "velocity", "intvelocity", "general", "motor", "cylinder"]
            )
            own = {
                "position": f'dampratio="{self.numbers(1, 0.5)}"',
                "general": f'biasprm="{self.numbers(1)}"',
            }
            gear = f'gear="{self.numbers(1, 0.5, 2)}"' * self.chance(0.5)
            more = own.get(kind, "") * self.chance(0.5)
            found.append(f'<{kind} joint="{joint}" {gear} {more} {self.of_class()}/>')
        return "".join(found)

    def text(self) -> str:
        defaults = (
            f'<default>{self.settings()}<default class="one">{self.settings()}'
            f'<default class="two">{self.settings()}</default></default>'
            f'<default class="three">{self.settings()}</default></default>'
        )
        world = self.body(int(self.random.integers(1, 3)), root=True)
        pairs = "".join(
            f'<joint joint="{name}" coef="{self.numbers(1)}"/>' for name in self.joints[-2:]
        )
        tendons = (
            f'<fixed stiffness="{self.numbers(1, 0, 9)}" damping="{self.numbers(1, 0)}">{pairs}'
            "</fixed>" * bool(self.joints)
        )
        tendons += (
            f'<spatial stiffness="{self.numbers(1, 0, 9)}" springlength="0.05 0.1">'
            f'<site site="{self.sites[0]}"/><site site="{self.sites[-1]}"/></spatial>'
        )
        fluid = f'density="{self.numbers(1, 1, 40)}" viscosity="{self.numbers(1, 0)}"'
        return (
            f'<mujoco><compiler angle="{"degree" if self.degrees else "radian"}" '
            f'eulerseq="{self.sequence}"/><option {fluid * self.chance(0.3)}/>{defaults}'
            f"<worldbody>{self.framed(world)}</worldbody><tendon>{tendons}</tendon>"
            f"<actuator>{self.actuators()}</actuator></mujoco>"
        )


class Urdf:
    """A tree of URDF: all joints of one freedom, fixed ones, mimics of mimics, links without
    mass."""

    KINDS = ("revolute", "continuous", "prismatic", "fixed")

    def __init__(self, seed: int):
        self.random = np.random.default_rng(seed)
        self.mimics: dict[str, tuple[str, float]] = {}

    def text(self) -> str:
        random, links, joints, moving = self.random, ['<link name="base"/>'], [], []
        count = int(random.integers(3, 6))
        for k in range(count):
            kind, name = (random.choice(self.KINDS) if k else "revolute"), f"j.{k}"
            last = k == count - 1 or random.random() < 0.7
            links.append(f'<link name="l.{k}">{self.mass() if last else ""}</link>')
            parent = f"l.{k - 1}" if k else "base"
            X = pose(random)
            turn = [*random.uniform(-3, 3, 2)]
            rpy = (turn[0], random.choice([np.pi / 2, -np.pi / 2, 0.4]), turn[1])
            mimic = ""
            if kind in ("revolute", "prismatic") and len(moving) > 1 and random.random() < 0.6:
                self.mimics[name] = moving[-1], float(random.uniform(-2, 2))
                of, factor = self.mimics[name]
                mimic = f'<mimic joint="{of}" multiplier="{factor!r}" offset="0.1"/>'
            if kind in ("revolute", "prismatic"):
                moving.append(name)
            joints.append(
                f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
                f'<child link="l.{k}"/><origin xyz="{words(X[:3, 3])}" rpy="{words(rpy)}"/>'
                f'<axis xyz="{words(random.normal(size=3))}"/>{mimic}'
                '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
            )
        return f'<robot name="r">{"".join(links + joints)}</robot>'

    def mass(self) -> str:
        mass = self.random.uniform(0.2, 2)
        I = tensor(self.random, mass)  # noqa: E741
        axes = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
        inertia = " ".join(f'i{key}="{I[at]!r}"' for key, at in axes.items()).replace(
            "np.float64(", ""
        )
        inertia = inertia.replace(")", "")
        turn, place = self.random.uniform(-3, 3, 3), self.random.uniform(-0.1, 0.1, 3)
        return (
            f'<inertial><origin xyz="{words(place)}" rpy="{words(turn)}"/>'
            f'<mass value="{mass!r}"/><inertia {inertia}/></inertial>'
        )


class Sdf:
    """A tree of SDF whose poses and axes are given from wherever that can be, and MJCF of the same
    links and joints."""

    def __init__(self, seed: int):
        random = self.random = np.random.default_rng(seed)
        count = int(random.integers(2, 5))
        self.model, self.inner = pose(random), pose(random)
        self.places = [pose(random, 0.5) for _ in range(count)]
        self.masses = random.uniform(0.3, 2, count)
        self.tensors = [tensor(random, mass) for mass in self.masses]
        self.hinges = [pose(random, 0.5) for _ in range(count)]
        self.axes = [Rotation.random(random_state=seed + k).as_matrix() for k in range(count)]
        kinds = ["revolute", "prismatic", "universal", "revolute"]
        self.kinds = [str(random.choice(kinds)) for _ in range(count)]
        self.nested = [bool(random.random() < 0.4) and k > 0 for k in range(count)]
        self.springs = random.uniform(1, 9, count)

    def written(self, X: np.ndarray, other: str = "") -> str:
        relative = f' relative_to="{other}"' if other else ""
        turn = Rotation.from_matrix(X[:3, :3])
        if self.random.random() < 0.4:
            numbers = words(X[:3, 3], turn.as_quat())
            return f'<pose{relative} rotation_format="quat_xyzw">{numbers}</pose>'
        degrees = self.random.random() < 0.4
        angles = words(X[:3, 3], turn.as_euler("xyz", degrees=degrees))
        unit = ' degrees="true"' * degrees
        return f"<pose{relative}{unit}>{angles}</pose>"

    def seen(self, k: int, inside: bool) -> str:
        """Return the name of a link in the model or in the one inside it."""
        name = "world" if k < 0 else f"l{k}"
        return f"inner::{name}" if k >= 0 and self.nested[k] and not inside else name

    def link(self, k: int, home: np.ndarray, frames: list) -> str:
        I = self.tensors[k]  # noqa: E741
        axes = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}
        inertia = "".join(f"<i{key}>{float(I[at])!r}</i{key}>" for key, at in axes.items())
        name, X = frames[self.random.integers(len(frames))] if frames else ("", home)
        return (
            f'<link name="l{k}">{self.written(inverse(X) @ self.places[k], name)}<inertial>'
            f"<mass>{float(self.masses[k])!r}</mass><inertia>{inertia}</inertia></inertial></link>"
        )

    def joint(self, k: int, inside: bool, frames: list) -> str:
        child, parent = self.seen(k, inside), self.seen(k - 1, inside)
        home = self.inner if inside else self.model
        bases = [("", self.places[k]), ("__model__", home), *frames]
        name, X = bases[self.random.integers(len(bases))]
        place, axes = self.written(inverse(X) @ self.hinges[k], name), []
        for tag, axis in zip(("axis", "axis2"), self.axes[k].T, strict=False):
            bases = [("", self.hinges[k]), (child, self.places[k]), ("__model__", home), *frames]
            name, X = bases[self.random.integers(len(bases))]
            said = f' expressed_in="{name}"' if name else ""
            spring = (
                f"<dynamics><spring_stiffness>{float(self.springs[k])!r}</spring_stiffness>"
                "<spring_reference>0.1</spring_reference><damping>0.2</damping></dynamics>"
            )
            axes.append(
                f"<{tag}><xyz{said}>{words(X[:3, :3].T @ axis)}</xyz>{spring}"
                f"<limit><effort>0</effort></limit></{tag}>"
            )
        axes = axes if self.kinds[k] == "universal" else axes[:1]
        return (
            f'<joint name="j{k}" type="{self.kinds[k]}">{place}<parent>{parent}</parent>'
            f"<child>{child}</child>{''.join(axes)}</joint>"
        )

    def frames(self, home: np.ndarray) -> tuple[str, list]:
        """Return frames, each relative to the one before it, with their places."""
        found, text, last, X = [], "", "", home
        for name in ("f", "g")[: self.random.integers(0, 3)]:
            place = pose(self.random)
            text += f'<frame name="{name}">{self.written(inverse(X) @ place, last)}</frame>'
            found.append((name, place))
            last, X = name, place
        return text, found

    def text(self) -> str:
        parts = {}
        for inside, home in ((False, self.model), (True, self.inner)):
            text, frames = self.frames(home)
            own = [k for k, nested in enumerate(self.nested) if nested == inside]
            text += "".join(self.link(k, home, frames) for k in own)
            # Joints stand where both of their links are known.
            both = [
                k
                for k, nested in enumerate(self.nested)
                if (nested and k > 0 and self.nested[k - 1]) == inside
            ]
            parts[inside] = text + "".join(self.joint(k, inside, frames) for k in both)
        inner = f'<model name="inner">{self.written(inverse(self.model) @ self.inner)}\
{parts[True]}</model>'
        inner = inner * any(self.nested)
        return (
            '<sdf version="1.9"><world name="w"><gravity>1 2 -9</gravity><model name="m">'
            f"{self.written(self.model)}{inner}{parts[False]}</model></world></sdf>"
        )

    def name(self, k: int) -> str:
        inside = self.nested[k] and k > 0 and self.nested[k - 1]
        return f"inner::j{k}" if inside else f"j{k}"

    def plainly(self) -> str:
        """Return the same as MJCF."""
        text = ""
        for k in reversed(range(len(self.places))):
            X = (inverse(self.places[k - 1]) if k else np.eye(4)) @ self.places[k]
            B, kind = inverse(self.places[k]), self.kinds[k]
            at = words((B @ self.hinges[k])[:3, 3])
            acting = f'stiffness="{float(self.springs[k])!r}" springref="0.1" damping="0.2"'
            names = (
                [f"{self.name(k)}.angle_1", f"{self.name(k)}.angle_2"]
                if kind == "universal"
                else [self.name(k)]
            )
            joints = "".join(
                f'<joint name="{name}" type="{"slide" if kind == "prismatic" else "hinge"}" '
                f'pos="{at}" axis="{words(B[:3, :3] @ axis)}" {acting}/>'
                for name, axis in zip(names, self.axes[k].T, strict=False)
            )
            I = self.tensors[k]  # noqa: E741
            own = words(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
            turn = Rotation.from_matrix(X[:3, :3]).as_quat(scalar_first=True)
            text = (
                f'<body pos="{words(X[:3, 3])}" quat="{words(turn)}">{joints}'
                f'<inertial pos="0 0 0" mass="{float(self.masses[k])!r}" fullinertia="{own}"/>'
                f"{text}</body>"
            )
        return (
            '<mujoco><compiler angle="radian"/><option gravity="1 2 -9"/>'
            f"<worldbody>{text}</worldbody></mujoco>"
        )
