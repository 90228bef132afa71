"""What hostile cases do with a robot, and what must come out of it.

Every task asserts; what the robot refuses it raises as a LinkworkError, whose reason is checked by
`refusal_holds`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Event

from tests.hostile import judges
from tests.hostile.changes import force_units, units
from tests.hostile.mechanisms import Subject
from tests.hostile.starts import Start
from tests.oracle.lagrange import OracleError

RTOL = {"rodas": 1e-7, None: 1e-8}
FIXED = {"rk4": 400, "symplectic_euler": 1500}
ALLOWED = {"rk4": 1e-4, "symplectic_euler": 0.05, "rodas": 1e-4}  # relative defect, else 1e-6
METHODS = (None, "sharp_smart", "dormand_prince", "dop853", "rk4", "symplectic_euler", "rodas")


@dataclass(frozen=True)
class Setting:
    """Hold what a task works on: the mechanism, where it starts, by which method, and its own
    random numbers."""

    subject: Subject
    start: Start
    method: str | None
    seed: int
    folder: Path

    @property
    def robot(self) -> lw.Robot:
        return self.subject.robot

    @property
    def rng(self) -> np.random.Generator:
        return np.random.default_rng(self.seed + 1)

    @property
    def forces(self) -> np.ndarray:
        """Constant forces of the actuators, in units of the plain mechanism."""
        return self.rng.normal(size=len(self.robot.actuators))

    @property
    def u(self) -> np.ndarray:
        """The same in the robot's units."""
        return self.forces * force_units(
            self.subject.judged, self.subject.length, self.subject.mass
        )

    @property
    def options(self) -> dict[str, Any]:
        """The method with its tolerances or step."""
        if self.method in FIXED:
            return {"method": self.method, "step": self.subject.duration / FIXED[self.method]}
        rtol = RTOL.get(self.method, 1e-9)
        return {
            "method": self.method,
            "rtol": rtol,
            "atol": rtol / 100 * min(1.0, self.subject.length),
        }

    @property
    def duration(self) -> float:
        return self.subject.duration

    @property
    def times(self) -> np.ndarray:
        """Chebyshev's points in a run's duration."""
        return judges.nodes()[0] * self.duration

    @property
    def allowed(self) -> float:
        """Relative defect of a run by this method."""
        return ALLOWED.get(self.method or "", 1e-6)

    def state(self, **kind: Any) -> lw.State:
        return self.start.state(self.subject, **kind)

    def run(self, state: lw.State, **options: Any) -> lw.Run:
        """Run for the usual time, saved at Chebyshev's points."""
        return self.robot.simulate(
            state, self.u, duration=self.duration, save_at=self.times, **(self.options | options)
        )

    def judge(self, run: lw.Run) -> None:
        """Require a run to be right; one that stopped early for a reason that holds is right until
        there."""
        if run.status is lw.Status.FINISHED:
            judges.run_is_right(self.subject, run, self.forces, self.allowed)
        else:
            stopped_for_a_reason(
                self.subject, run.status, run.message, np.asarray(run.attrs["final_q"])
            )


# Tasks


def forward(of: Setting) -> None:
    """Accelerations, energies and forces at the start."""
    judges.state_is_right(of.subject, of.state(), of.forces)


def other_chart(of: Setting) -> None:
    """The same in other independent rates, and a run from there."""
    state = of.state(other_chart=True)
    judges.state_is_right(of.subject, state, of.forces)
    of.judge(of.run(state))


def simulate(of: Setting) -> None:
    """A run begins where it is told to, and solves the equations of motion."""
    state = of.state()
    run = of.run(state)
    given = of.start.positions(of.subject)
    size = units(of.subject.judged, of.subject.judged.coordinates, of.subject.length)
    first = run.dataset["joint_position"].values[0]
    judges.agree(
        "the first positions",
        same_turns(first, given, of.subject) / size,
        given / size,
        max(1e-7, of.subject.accuracy),
    )
    of.judge(run)


def step_over(of: Setting) -> None:
    """Singular poses are passed or not there at all."""
    of.judge(of.run(of.state(), on_singular="step_over"))


def ensemble(of: Setting) -> None:
    """Every member comes to what it comes to alone; one of them is judged."""
    state, rng = of.state(), of.rng
    factors = rng.uniform(-1.5, 1.5, 4)
    states = stacked([state.with_rates(state.rates * factor) for factor in factors])
    many = of.robot.ensemble(states, of.u, duration=of.duration, save_at=of.times, **of.options)
    positions, rates = (many.dataset[name].values for name in ("joint_position", "joint_rate"))
    for i in range(len(factors)):
        alone = of.run(states.at(i))
        assert many.status[i] == alone.status, (
            f"member {i}: {many.message(i)} Alone: {alone.message}"
        )
        assert alone.message == many.message(i)
        kept = len(alone.dataset["time"])
        for found, name in ((positions, "joint_position"), (rates, "joint_rate")):
            expected = alone.dataset[name].values
            judges.agree(f"member {i}'s {name}", found[i][:kept], expected, 1e-9)
            assert np.isnan(found[i][kept:]).all()
    of.judge(alone)


def resume(of: Setting) -> None:
    """Two halves, the first saved to a file and loaded, are as good as the whole."""
    state = of.state()
    whole = of.run(state)
    half = of.robot.simulate(state, of.u, duration=of.duration / 2, **of.options)
    if half.success:
        half.save(of.folder / "half.nc")
        half = lw.Run.load(of.folder / "half.nc")
        last = of.robot.resume(
            half, of.u, duration=of.duration / 2, save_at=(of.duration + of.times) / 2, **of.options
        )
        assert last.status == whole.status, f"{last.message} Whole: {whole.message}"
        if last.success:
            judges.run_is_right(of.subject, last, of.forces, of.allowed)
            ends = [run.dataset["joint_position"].values[-1] for run in (last, whole)]
            size = units(of.subject.judged, of.subject.judged.coordinates, of.subject.length)
            judges.agree(
                "the ends of the halves and the whole",
                ends[0] / size,
                ends[1] / size,
                1e3 * max(of.allowed, of.subject.accuracy),
            )
    of.judge(whole)


def events(of: Setting) -> None:
    """Every time at which a coordinate passes a value is found, and no other."""
    state, scalar = (
        of.state(),
        [name for name in of.robot.coordinates if not name.endswith((".qw", ".qx", ".qy", ".qz"))],
    )
    name = str(of.rng.choice(scalar))
    index = of.robot.coordinates.index(name)
    plain = of.run(state)
    of.judge(plain)
    if not plain.success:
        return
    fine = of.robot.simulate(
        state, of.u, duration=of.duration, save_at=np.linspace(0, of.duration, 1201), **of.options
    )
    q, t = fine.dataset["joint_position"].values[:, index], fine.dataset["time"].values
    level = (
        float(np.quantile(q, 0.3702))
        if np.ptp(q) > 1e-9 * of.subject.length
        else float(q[0]) + of.subject.length
    )
    run = of.run(state, events=[Event(lambda t, state: state[name] - level, name="passes")])
    passed = np.flatnonzero((q[1:] - level) * (q[:-1] - level) < 0)
    found = run.dataset.event_time.values
    assert len(found) == len(passed), (
        f"{name} passes {level:.6g} {len(passed)} times, from {t[passed][:3]} on, not at "
        f"{found[:3]}"
    )
    assert np.all((t[passed] - 1e-6 <= found) & (found <= t[passed + 1] + 1e-6))
    judges.agree(
        "a run with events",
        run.dataset["joint_position"].values,
        plain.dataset["joint_position"].values,
        1e-9,
    )


def written(of: Setting) -> None:
    """The mechanism written to a file and read again is the same; so are its accelerations."""
    path = of.folder / "mechanism.yaml"
    of.subject.described.save(path)
    again = replace(of.subject, name="again", change=lambda _: lw.Mechanism.load(path))
    assert again.described == of.subject.described
    state = of.state()
    other = again.robot.state(
        state.positions, dict(zip(state.independent, state.rates, strict=True))
    )
    judges.state_is_right(again, other, of.forces)


def energy(of: Setting) -> None:
    """Over a longer time, without actuators, energy changes by what friction and dampers take;
    here: never grows."""
    run = of.robot.simulate(
        of.state(),
        duration=10 * of.duration,
        save_at=np.linspace(0, 10 * of.duration, 41),
        **of.options,
    )
    if not run.success:
        return stopped_for_a_reason(
            of.subject, run.status, run.message, np.asarray(run.attrs["final_q"])
        )
    found = []
    for q, w in zip(
        run.dataset["joint_position"].values[::8],
        run.dataset["joint_rate"].values[::8],
        strict=True,
    ):
        seen = judges.Seen.of(of.subject, q, w)
        judges.closed(of.subject, seen)
        found.append(sum(seen.oracle.energy(seen.poses, seen.twists)))
    scale, told = 1 + np.ptp(found) + np.abs(found).max(), run.dataset["energy_balance"].values
    assert np.isfinite(told).all(), f"the energy balance is {told}"
    grown = (
        max(np.maximum.accumulate(found[::-1])[::-1] - found) if dissipative(of) else np.ptp(found)
    )
    assert grown <= 100 * of.allowed * scale, (
        f"energies are {found}, with nothing that adds any ({run.message})"
    )


TASKS: dict[str, Callable[[Setting], None]] = {
    "forward dynamics": forward,
    "other chart": other_chart,
    "simulate": simulate,
    "step over": step_over,
    "ensemble": ensemble,
    "resume": resume,
    "events": events,
    "written": written,
    "energy": energy,
}


def dissipative(of: Setting) -> bool:
    """Tell whether friction or dampers act."""
    parts = [
        part for joint in of.subject.judged.pairs.values() for part in joint.effects().values()
    ]
    losses = [
        friction.viscous + friction.coulomb + spring.damping for friction, spring, *_ in parts
    ]
    return any(losses) or any(spring.damping for spring in of.subject.judged.springs.values())


def same_turns(found: np.ndarray, given: np.ndarray, subject: Subject) -> np.ndarray:
    """Return coordinates with quaternions of the sign that is given."""
    found = found.copy()
    for name, joint in subject.judged.pairs.items():
        if "turn" in joint.freedoms:
            at = [subject.judged.coordinates.index(label) for label in joint.coordinates(name)[-4:]]
            found[at] *= 1 if found[at] @ given[at] > 0 else -1
    return found


def stacked(states: list[lw.State]) -> lw.State:
    """Stack states."""
    parts = {
        name: np.stack([getattr(state, name) for state in states])
        for name in ("positions", "rates", "q")
    }
    return replace(states[0], **parts)


# Reasons


def stopped_for_a_reason(subject: Subject, status: lw.Status, message: str, q: np.ndarray) -> None:
    """A run may stop where the constraints become dependent, and nowhere else."""
    positions = subject.robot.kernel("positions")(q)[0]
    assert status in (lw.Status.SINGULAR, lw.Status.CLOSURE_LOST), message
    assert judges.dependent(subject, positions), (
        f"{message} But the constraints are independent there."
    )


def refusal_holds(subject: Subject, begin: Start | None, error: lw.LinkworkError) -> None:
    """A mechanism may be refused where it cannot be assembled; a state, where its rates do not
    determine the motion."""
    if begin is None:
        with pytest.raises(OracleError):
            subject.oracle.assemble(subject.oracle.poses(subject.judged.reference))
        assert "do not close" in str(error) or "singular" in str(error), str(error)
        return
    assert "singular" in str(error) or "do not determine" in str(error), str(error)
    weak = judges.weak_rates(subject, begin.positions(subject), subject.robot.independent)
    assert weak < 1e-3, f"{error} But these rates show {weak:.3g} of the motion."
