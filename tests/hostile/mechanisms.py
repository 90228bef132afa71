"""The mechanisms of the hostile cases: what is described, the plain one that it is judged by, and
in which units.

The plain mechanism has the same motion in units of about 1 m and 1 kg, and no rounding in its
numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property, partial
from math import asin, pi

import numpy as np

import linkwork as lw
from linkwork import robots
from linkwork.mechanism import Body, Frame, FreeJoint, Inertia, Mechanism

from tests.hostile import changes
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import random_loops, random_tree, tilted
from tests.oracle.random_mechanisms import open_tree, planar_loops, spatial_loops

BOX = Inertia(xx=0.1, yy=0.12, zz=0.15)
EXACT, NOISY, ROUNDED = 1e-9, 1e-7, 2e-4
# Robots that do much in little time [s]
QUICK = {"andrews": 0.01, "flyball_governor": 0.03, "rrs3": 0.1}


@dataclass(frozen=True)
class Subject:
    """Hold how a mechanism is made.

    plain: makes the mechanism that it is judged by; change: makes of that the one that is described
    length, mass: units of the described mechanism, in those of the plain one
    accuracy: relative, to which the two agree; duration: of runs [s], in which it moves by about
    its size
    """

    name: str
    plain: Callable[[], Mechanism]
    change: Callable[[Mechanism], Mechanism] = lambda mechanism: mechanism
    length: float = 1.0
    mass: float = 1.0
    accuracy: float = EXACT
    duration: float = 0.3

    @cached_property
    def judged(self) -> Mechanism:
        return self.plain()

    @cached_property
    def described(self) -> Mechanism:
        return self.change(self.judged)

    @cached_property
    def robot(self) -> lw.Robot:
        return lw.Robot(self.described)

    @cached_property
    def oracle(self) -> MaximalOracle:
        return MaximalOracle(self.judged)


def catalogue() -> Iterator[Subject]:
    """Yield the robots of the catalogue."""
    for name in robots.__all__:
        yield Subject(name.replace("_", " "), getattr(robots, name), duration=QUICK.get(name, 0.3))


def random() -> Iterator[Subject]:
    """Yield random trees and loops, planar and spatial, with and without springs, friction, rotors,
    gears and rods."""
    for seed in range(1, 6):
        yield Subject(
            f"planar loops {seed}", partial(planar_loops, seed, 1 + seed % 3, 1 + seed % 2)
        )
        yield Subject(
            f"planar effects {seed}",
            partial(random_loops, seed, 1 + seed % 2, planar=True, effects=True),
        )
    for seed in range(1, 4):
        yield Subject(f"spatial loop {seed}", partial(spatial_loops, seed, 1, 1 + seed % 2))
        yield Subject(f"mixed loop {seed}", partial(random_loops, seed, 1, effects=seed % 2 == 0))
        yield Subject(f"tree {seed}", partial(random_tree, seed, 4, effects=True))
        yield Subject(f"open tree {seed}", partial(open_tree, seed, 4, planar=seed % 2 == 0))
        yield Subject(
            f"tilted loop {seed}",
            lambda s=seed: tilted(random_loops(s, 1, planar=True, effects=True), s),
        )
    yield Subject("geared loop", partial(random_loops, 11, 1, planar=True, gears=1))
    yield Subject("rods", partial(random_loops, 12, 1, planar=True, rods=1))
    yield Subject("hexapod", partial(random_loops, 13, 0, platform="free"))
    yield Subject(
        "too many motors", partial(random_loops, 14, 1, freedoms=2, planar=True, actuation=1)
    )
    yield Subject(
        "too few motors", partial(random_loops, 15, 1, freedoms=2, planar=True, actuation=-1)
    )


PLANAR = {
    "five bar": partial(robots.five_bar, gravity=(0, -9.81, 0)),
    "four bar": robots.four_bar,
    "prr3": robots.prr3,
    "rpr3": robots.rpr3,
    "slider crank": robots.slider_crank,
}
SPATIAL = {
    "bennett": robots.bennett,
    "bricard": robots.bricard,
    "spatial slider crank": robots.spatial_slider_crank,
    "delta": robots.delta,
    "mixed loop 2": partial(random_loops, 2, 1, effects=True),
}
REDUNDANT = ("bennett", "bricard")


def rounded_numbers() -> Iterator[Subject]:
    """Yield mechanisms whose numbers hold noise, or have six decimals."""
    for seed, (name, plain) in enumerate((PLANAR | SPATIAL).items()):
        yield Subject(f"noisy {name}", plain, partial(changes.noisy, seed=seed), accuracy=NOISY)
        if name in REDUNDANT:
            yield Subject(f"rounded {name}", plain, changes.rounded, accuracy=ROUNDED)
        else:
            yield Subject(f"rounded {name}", lambda plain=plain: changes.rounded(plain()))


def other_units() -> Iterator[Subject]:
    """Yield mechanisms with lengths and masses far from 1."""
    sizes = [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6), (1e-6, 1e-6), (1e-3, 1e3)]
    plain = PLANAR | SPATIAL | {"tree 1": partial(random_tree, 1, 4, effects=True)}
    chosen = [
        "five bar",
        "prr3",
        "slider crank",
        "delta",
        "bennett",
        "mixed loop 2",
        "tree 1",
        "four bar",
        "rpr3",
    ]
    for i, name in enumerate(chosen):
        for length, mass in (sizes[i % 6], sizes[(i + 1) % 6]):
            change = partial(changes.scaled, length=length, mass=mass)
            yield Subject(f"{name} x{length:g} m x{mass:g} kg", plain[name], change, length, mass)


def floating() -> Iterator[Subject]:
    """Yield mechanisms on a free base, with and without loops."""
    yield Subject("two floating bodies", two_floating_bodies)
    yield Subject(
        "floating tree",
        lambda: changes.floating(random_tree(21, 3, kinds=("revolute", "universal"))),
    )
    yield Subject("floating four bar", lambda: changes.floating(robots.four_bar()))
    yield Subject("floating slider crank", lambda: changes.floating(robots.slider_crank()))
    yield Subject(
        "free body",
        lambda: Mechanism(
            bodies={"top": Body(mass=2.0, inertia=BOX)},
            joints={"float": FreeJoint(connects=("ground", "top"))},
        ),
    )


def flat() -> Iterator[Subject]:
    """Yield mechanisms that are drawn in a line, or start where branches of their motion meet."""
    yield Subject("flat parallelogram", partial(parallelogram, flat=True))
    yield Subject("folding parallelogram", partial(parallelogram, flat=False))
    yield Subject("n four bar 3", partial(robots.n_four_bar, 3))
    yield Subject(
        "stretched arm", lambda: robots.double_pendulum().model_copy(update={"reference": {}})
    )
    yield Subject("dead centre", dead_centre)
    yield Subject("stretched five bar", stretched_five_bar)


def redundant() -> Iterator[Subject]:
    """Yield mechanisms with more constraints than their freedoms need."""
    yield Subject("sarrus", sarrus)
    yield Subject("three cranks", three_cranks)
    yield Subject("cardan shaft", cardan_shaft)
    yield Subject("doubled hinge", doubled_hinge)


def two_floating_bodies() -> Mechanism:
    """A floating base with a leg on a hinge."""
    return Mechanism(
        bodies={
            "base": Body(mass=1.0, inertia=BOX),
            "leg": Body(mass=0.5, centre_of_mass=(0, 0, -0.3), inertia=BOX),
        },
        joints={
            "float": FreeJoint(connects=("ground", "base")),
            "hip": lw.RevoluteJoint(
                connects=("base", "leg"),
                frames=(Frame(position=(0.1, 0, -0.1)), Frame()),
                axis=(0, 1, 0),
            ),
        },
        actuators=("hip",),
    )


def parallelogram(flat: bool) -> Mechanism:
    """A parallelogram linkage; flat: with all bars in one line and no reference."""
    described = robots.four_bar(ground=1.0, crank=0.5, coupler=1.0, rocker=0.5)
    bent = {"crank_pivot": 1.2, "crank_pin": -1.2, "rocker_pivot": 1.2, "rocker_pin": 1.2}
    return described.model_copy(update={"reference": {} if flat else bent})


def dead_centre() -> Mechanism:
    """A slider-crank at its dead centre, driven at the slider."""
    described = robots.slider_crank()
    reference = dict.fromkeys(described.reference, 0.0)
    slide = next(name for name, joint in described.joints.items() if joint.type == "prismatic")
    return described.model_copy(update={"reference": reference, "actuators": (slide,)})


def stretched_five_bar() -> Mechanism:
    """A five-bar whose elbows are stretched at home: its tip has fewer freedoms there, the linkage
    has not."""
    return robots.five_bar().model_copy(update={"reference": {}})


def hinge(first: str, second: str, position, far, axis=(0, 0, 1)) -> lw.RevoluteJoint:
    """Hinge two bodies at points of both."""
    return lw.RevoluteJoint(
        connects=(first, second), frames=(Frame(position=position), Frame(position=far)), axis=axis
    )


def sarrus() -> Mechanism:
    """Two pairs of plates between ground and a table that they lead straight up: six hinges, one
    row too many."""
    plate, bodies, joints, reference = 0.5, {"table": Body(mass=2.0, inertia=BOX)}, {}, {}
    lean = asin(0.6 / (2 * plate))  # of a plate to the horizontal, at a height of 0.6 m
    for name, turn in (("a", 0.0), ("b", 1.9)):
        out, axis = np.array([np.cos(turn), np.sin(turn), 0.0]), (-np.sin(turn), np.cos(turn), 0.0)
        foot, link = tuple(0.4 * out), tuple(plate * out)
        bodies |= {
            f"{side}_{name}": Body(mass=0.7, centre_of_mass=tuple(plate / 2 * out), inertia=BOX)
            for side in ("low", "high")
        }
        joints[f"{name}_1"] = hinge("ground", f"low_{name}", foot, (0, 0, 0), axis)
        joints[f"{name}_2"] = hinge(f"low_{name}", f"high_{name}", link, (0, 0, 0), axis)
        joints[f"{name}_3"] = hinge(f"high_{name}", "table", link, foot, axis)
        reference |= {f"{name}_1": -lean, f"{name}_2": 2 * lean - pi, f"{name}_3": pi - lean}
    return Mechanism(bodies=bodies, joints=joints, reference=reference, actuators=("a_1",))


def three_cranks() -> Mechanism:
    """A coupler on three equal parallel cranks: one crank more than it needs."""
    bodies, joints, reference = (
        {"coupler": Body(mass=2.0, centre_of_mass=(0.6, 0.1, 0), inertia=BOX)},
        {},
        {},
    )
    for i, x in enumerate((0.0, 0.7, 1.3), start=1):
        bodies[f"crank_{i}"] = Body(mass=0.5, centre_of_mass=(0.2, 0, 0), inertia=BOX)
        joints[f"pivot_{i}"] = hinge("ground", f"crank_{i}", (x, 0, 0), (0, 0, 0))
        joints[f"pin_{i}"] = hinge(f"crank_{i}", "coupler", (0.4, 0, 0), (x, 0, 0))
        reference |= {f"pivot_{i}": 1.1, f"pin_{i}": -1.1}
    return Mechanism(
        gravity=(0, -9.81, 0),
        bodies=bodies,
        joints=joints,
        reference=reference,
        actuators=("pivot_1",),
    )


def cardan_shaft() -> Mechanism:
    """Two shafts at an angle, joined by a universal joint that both bearings' axes meet in."""
    bend = 0.4
    return Mechanism(
        bodies={
            "input": Body(mass=1.0, inertia=BOX),
            "output": Body(mass=1.0, centre_of_mass=(0.1, 0.02, 0), inertia=BOX),
        },
        joints={
            "bearing_1": lw.RevoluteJoint(connects=("ground", "input"), axis=(1, 0, 0)),
            "cross": lw.UniversalJoint(connects=("input", "output"), axes=((0, 1, 0), (0, 0, 1))),
            "bearing_2": lw.RevoluteJoint(
                connects=("output", "ground"),
                frames=(Frame(), Frame(rotation=(0, 0, bend))),
                axis=(1, 0, 0),
            ),
        },
        reference={"cross.angle_2": bend},
        actuators=("bearing_1",),
    )


def doubled_hinge() -> Mechanism:
    """A door on two hinges."""
    return Mechanism(
        bodies={"door": Body(mass=5.0, centre_of_mass=(0.4, 0, 0.5), inertia=BOX)},
        joints={
            "low": hinge("ground", "door", (0, 0, 0.2), (0, 0, 0.2)),
            "high": hinge("ground", "door", (0, 0, 0.9), (0, 0, 0.9)),
        },
        gravity=(1.0, 2.0, -9.81),
        actuators=("low",),
    )


FAMILIES = (catalogue, random, rounded_numbers, other_units, floating, flat, redundant)


@cache
def subjects() -> dict[str, Subject]:
    """Return all subjects by name, each made once."""
    return {subject.name: subject for family in FAMILIES for subject in family()}
