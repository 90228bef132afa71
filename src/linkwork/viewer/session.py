"""What happens in the viewer, without a browser: one robot that is posed by hand or follows a run.

A session is told what is wanted (drag, slide, play ...) and then, tick by tick, how much time has
passed; `view` tells what is to be seen. All browsers that look at it see the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from linkwork import checks
from linkwork.equations.algebra import wrapped
from linkwork.errors import LinkworkError
from linkwork.mechanism import GROUND
from linkwork.robot import Robot, State
from linkwork.scene.fixtures import Fixtures, fixtures_of
from linkwork.scene.layout import PartLayout, Placement
from linkwork.scene.rails import Rail, along, grown, rails_of
from linkwork.scene.skeleton import poses_of
from linkwork.simulation import Run
from linkwork.viewer.arrows import NOTHING, ArrowField, ArrowLines, Arrows, drawn
from linkwork.viewer.hand_goals import HandGoal, ToolGoal, rotation_matrix
from linkwork.viewer.marks import BodyMarks, Marks, marks_of
from linkwork.viewer.named_dexterity import CONDITIONING, PoseMeasure, measured
from linkwork.viewer.player import Player
from linkwork.viewer.pulling import Live
from linkwork.viewer.pursuit import Pursuit
from linkwork.viewer.replay import Replay, replay_of
from linkwork.viewer.trail import HandTrail, RunTrail, segments, tool_points

KINDS = ("actuator forces", "joint reactions", "velocities")
SAMPLED = 25  # states of a run at which the largest reactions and velocities are looked for


@dataclass(frozen=True, eq=False)
class Pulled:
    """Hold where a hand may pull at a body, or pulls: the body's name, the place (3) [m], the
    hand's place (3) [m] and its force (3) [N]; without a hand None and zero."""

    body: str
    place: np.ndarray
    hand: np.ndarray | None
    force: np.ndarray


@dataclass(frozen=True, eq=False)
class View:
    """Hold what is to be seen of a robot at one instant.

    placement: where all parts are, rails excepted, which grow; over: those of the run that is laid
        over, or None; tool: position (3) [m] and
        orientation (3, 3) of the tool, or None; angle: of a planar tool, as it is led [rad]
    arrows, marks: by kind, those that are shown; trail: lines (s, 2, 3) where the tools were [m],
        none where it is not shown; focus: the tool, or what the camera follows (3) [m]
    conditioning: 0 to 1; measured: what is told beside it; closure: largest |phi| [m, rad]
    coordinates: of all joints by name [m, rad]; forces: of the actuators by name [N, N m], or None
        where none are defined
    time: of the run, or of the simulation that goes on [s], or None while posing; pulled: where a
        hand may pull in that, or None; notice: one sentence on what stands in the way, or
        empty
    """

    placement: Placement
    over: Placement | None
    rails: tuple[Rail, ...]
    tool: tuple[np.ndarray, np.ndarray] | None
    angle: float | None
    arrows: Mapping[str, ArrowLines]
    marks: Mapping[str, Marks]
    trail: np.ndarray
    focus: np.ndarray
    conditioning: float
    measured: PoseMeasure
    closure: float
    coordinates: Mapping[str, float]
    forces: Mapping[str, float] | None
    time: float | None
    pulled: Pulled | None
    notice: str


@dataclass(eq=False)
class Session:
    """Hold the present state of what is shown; all its methods belong to one thread.

    state: what is shown; live: a simulation that goes on; hand: where a hand pulls in it (3) [m]
    goal: what is wanted of the state, if anything; replay, path, player: the run,
        where it leads the tools, and where it stands; over: another one, shown at the same times
    following: whether the state is that of the run; shown: kinds of arrows, names and frames;
        trailing: whether the tools' trail is; measure: the name of what is told of the pose
    led: where a hand has led the tools; notice: one sentence on what stands in the way, or was
        passed; passed: the singular pose that was passed since the hand let go last
    rails: as long as what was shown of the present run, or of posing, needs
    largest: magnitudes of straight and of turning arrows, by kind, that are drawn in full along the
        run
    """

    robot: Robot
    state: State = field(init=False)
    goal: HandGoal | None = None
    replay: Replay | None = None
    over: Replay | None = None
    live: Live | None = None
    hand: np.ndarray | None = None
    path: RunTrail | None = None
    player: Player = field(default_factory=Player)
    following: bool = False
    shown: frozenset[str] = frozenset()
    trailing: bool = False
    measure: str = CONDITIONING
    led: HandTrail = field(default_factory=HandTrail)
    notice: str = ""
    passed: str = ""
    rails: tuple[Rail, ...] = field(init=False)
    largest: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.state = self.robot.home
        self.rails = rails_of(self.robot, [part.role for part in self.parts.parts])

    # What never changes

    @cached_property
    def parts(self) -> Fixtures:
        return fixtures_of(self.robot)

    @cached_property
    def layout(self) -> PartLayout:
        return PartLayout(self.robot, self.parts)

    @cached_property
    def pursuit(self) -> Pursuit:
        return Pursuit(self.robot, self.parts.size)

    @cached_property
    def vectors(self) -> ArrowField:
        return ArrowField.of(self.robot, self.parts.size)

    @cached_property
    def marks(self) -> dict[str, BodyMarks]:
        return marks_of(self.robot)

    @cached_property
    def sliders(self) -> dict[str, tuple[float, float]]:
        """Return the joint coordinates that are set by hand, with their ranges [m, rad].

        These are the actuated ones, or where none are, or a drive pulls at several joints, the
        independent ones; a range is that of the limits, or half a turn, or half the mechanism's
        size, to both sides.
        """
        driven = self.robot.actuators
        of_joints = bool(driven) and set(driven) <= set(self.robot.coordinates)
        names = driven if of_joints else self.robot.independent
        found = {}
        for name in names:
            if name not in self.robot.coordinates or name not in self.robot.rates:
                continue
            here = float(self.robot.home[name])
            reach = 0.5 * self.parts.size if self.robot.unit(name) == "m" else np.pi
            own = {bound.side: bound.bound for bound in self.pursuit.bounds if bound.name == name}
            low, high = min(own.get(-1, here - reach), here), max(own.get(1, here + reach), here)
            found[name] = (float(np.floor(low * 100) / 100), float(np.ceil(high * 100) / 100))
        return found

    # Wishes

    def drag(self, position: np.ndarray, orientation: np.ndarray) -> None:
        """Want the tool at a position (3) [m] in an orientation (3, 3), in the ground's axes."""
        self.pose_by_hand()
        p, R = self.base()
        self.goal = self.pursuit.tool_goal(R.T @ (position - p), R.T @ orientation)

    def turn(self, angle: float) -> None:
        """Want a planar tool's x axis at an angle to the ground's, or to that of what its pose is
        relative to [rad], and the tool where it is."""
        angle = checks.number(angle, "the tool's angle")
        wanted, out = self.goal, self.pursuit.assembler.still(self.state.q)
        kept = wanted.position if isinstance(wanted, ToolGoal) else out["position"]
        self.pose_by_hand()
        way = rotation_matrix((angle - float(out["angle"][0])) * np.eye(3)[2])
        self.goal = self.pursuit.tool_goal(kept, way @ out["orientation"].reshape(3, 3))

    def slide(self, name: str, value: float) -> None:
        """Want one actuated coordinate [m, rad] at a value, the others where they are."""
        value = checks.number(value, name)
        self.pose_by_hand()
        self.passed, targets = "", {other: float(self.state[other]) for other in self.sliders}
        self.goal = self.pursuit.joint_goal(targets | {name: value})

    def release(self) -> None:
        """Want nothing further: stay where the robot is."""
        self.goal, self.passed = None, ""

    def show(self, state: State, notice: str = "") -> None:
        """Show a state of this robot, at rest."""
        self.pose_by_hand()
        self.state, self.goal = self.robot.own(state), None
        self.notice, self.passed = notice, ""
        self.led = HandTrail()

    def load(self, run: Run) -> None:
        """Show a run of this robot from its start.

        Raises:
            LinkworkError: the run is not one of this robot.
        """
        replay = replay_of(self.pursuit, run)
        self.end()
        self.replay, self.goal, self.path = replay, None, RunTrail(replay)
        if replay.empty:
            self.player = Player()
            self.notice = "the run holds no samples: there is nothing to play"
            return
        self.player = Player.of(float(replay.time[0]), float(replay.time[-1]))
        self.lay_over(None if self.over is None else self.over.run)
        self.largest = {kind: self.largest_of(kind, replay) for kind in KINDS}
        self.following = False
        self.follow_run()

    def lay_over(self, run: Run | None) -> None:
        """Show another run of this robot at the times of the one that is played, or none; the
        shorter one stands still at its end.

        Raises:
            LinkworkError: the run is not one of this robot.
        """
        replay = None if run is None else replay_of(self.pursuit, run)
        self.over = None if replay is None or replay.empty else replay
        shown = [each for each in (self.replay, self.over) if each is not None and not each.empty]
        if self.playable:
            end = max(float(each.time[-1]) for each in shown)
            self.player = replace(self.player, end=end, time=min(self.player.time, end))
        if shown:
            q = np.concatenate([each.q for each in shown])
            states = self.robot.make_state(q, np.zeros((len(q), self.robot.mobility)))
            self.rails = along(self.rails, self.robot, states)

    def largest_of(self, kind: str, replay: Replay) -> tuple[float, float]:
        """Return the largest magnitudes of a kind of arrows over a run, at some of its samples."""
        times = replay.time[np.unique(np.linspace(0, len(replay.time) - 1, SAMPLED).astype(int))]
        each = [self.of_kind(kind, replay.state(t), replay.forces_at(t)).largest() for t in times]
        return max(straight for straight, _ in each), max(turning for _, turning in each)

    def pose_by_hand(self) -> None:
        """Stop playing, or what goes on; what is shown stays where it is, at rest."""
        self.end()
        if self.following:
            self.led = HandTrail()
        self.player, self.following = replace(self.player, playing=False), False
        self.state = self.state.with_rates(np.zeros(self.robot.mobility))

    def play(self) -> None:
        """Play or pause the run."""
        if self.playable:
            self.end()
            self.player = self.player.toggled()
            self.follow_run()

    def seek(self, time: float) -> None:
        """Go to a time of the run [s]."""
        time = checks.number(time, "the time")
        if self.playable:
            self.end()
            self.player = self.player.at(time)
            self.follow_run()

    @property
    def playable(self) -> bool:
        """Tell whether there is a run with samples."""
        return self.replay is not None and not self.replay.empty

    # Time

    @property
    def active(self) -> bool:
        """Tell whether anything moves by itself."""
        return self.live is not None or self.goal is not None or self.player.playing

    def advance(self, seconds: float) -> bool:
        """Let time pass; return whether anything moved.

        seconds: so many.
        """
        if self.live is not None:
            return self.go_on(self.live, seconds)
        if self.goal is not None:
            self.led.add(tool_points(self.robot, self.state))
            reached = self.pursuit.step(self.state, self.goal)
            self.passed, self.state = reached.passed or self.passed, reached.state
            still = self.goal.unled(self.pursuit.assembler.still(self.state.q))
            self.notice = "; ".join(filter(None, (reached.obstacle, self.passed, still)))
            if reached.arrived or reached.obstacle:
                self.goal = None
            return True
        if self.player.playing:
            self.player = self.player.advanced(seconds)
            self.follow_run()
            return True
        return False

    def go_on(self, live: Live, seconds: float) -> bool:
        """Let a simulation go on for some seconds; it ends where the motion does, which is said."""
        if not seconds > 0:
            return False
        try:
            live.advance(seconds, self.hand)
        except LinkworkError as error:
            self.end()
            self.notice = f"the simulation ended: {error}"
            return True
        self.state = live.state
        return True

    def begin(self, live: Live) -> None:
        """Let a simulation go on from now on."""
        self.pose_by_hand()
        self.live, self.goal, self.notice = live, None, ""

    def end(self) -> None:
        """Let no simulation go on any more, and no hand pull."""
        self.live, self.hand = None, None

    def follow_run(self) -> None:
        """Show the run where it stands; what was said of a pose by hand is said no longer."""
        if self.replay is None or self.replay.empty:
            return
        if not self.following:
            self.following, self.notice = True, self.replay.told
        self.state = self.replay.state(self.player.time)

    # What is seen

    def view(self) -> View:
        """Return what is to be seen now."""
        # The tool, in the ground's axes.
        robot, state = self.robot, self.state
        out = self.pursuit.assembler.still(state.q)
        p, R = self.base()
        tool = (
            (p + R @ out["position"], R @ out["orientation"].reshape(3, 3))
            if robot.mechanism.tools
            else None
        )
        # Forces, and poses of all bodies, for which the rails are long enough.
        u = self.forces()
        poses = poses_of(robot, state)
        self.rails = grown(self.rails, poses)
        conditioned = measured(robot, state, CONDITIONING)
        told = conditioned if self.measure == CONDITIONING else measured(robot, state, self.measure)
        # All of it; what is laid over at the same time.
        time = self.live.time if self.live else self.player.time
        return View(
            placement=self.layout.place(state),
            over=self.layout.place(self.over.state(time)) if self.over else None,
            rails=self.rails,
            tool=tool,
            angle=float(wrapped(out["angle"][0])) if tool and robot.planar else None,
            arrows={kind: self.arrows(kind, u) for kind in KINDS if kind in self.shown},
            marks={
                kind: marks.at(poses) for kind, marks in self.marks.items() if kind in self.shown
            },
            trail=self.trail() if self.trailing else np.empty((0, 2, 3)),
            focus=poses[robot.bodies[0]][0] if tool is None else tool[0],
            conditioning=conditioned.share,
            measured=told,
            closure=float(np.abs(out["phi"]).max(initial=0.0)),
            coordinates=dict(zip(robot.coordinates, state.positions.tolist(), strict=True)),
            forces=None if u is None else dict(zip(robot.actuators, u.tolist(), strict=True)),
            time=time if self.live or self.following else None,
            pulled=self.pulled(),
            notice=self.notice,
        )

    def pulled(self) -> Pulled | None:
        """Return where a hand pulls, or may pull; None where nothing goes on."""
        live, hand = self.live, self.hand
        if live is None:
            return None
        place = live.pull.place(self.robot, self.state)
        return Pulled(live.pull.body, place, hand, live.force(hand))

    def trail(self) -> np.ndarray:
        """Return the lines (s, 2, 3) along which the tools came here [m]: those of the run so far,
        or of the hand."""
        here = tool_points(self.robot, self.state)
        if self.following and self.path is not None:
            return segments(self.path.until(self.player.time), here)
        return segments(np.array(self.led.points), here)

    def base(self) -> tuple[np.ndarray, np.ndarray]:
        """Return p_0B (3) [m] and R_0B (3, 3) of what the tool's pose is relative to."""
        mechanism = self.robot.mechanism
        body = mechanism.first_tool.relative_to if mechanism.tools else GROUND
        if body == GROUND:
            return np.zeros(3), np.eye(3)
        return self.robot.body_poses(self.state)[body]

    def forces(self) -> np.ndarray | None:
        """Return the actuators' forces [N, N m]: those of the run, or those that hold the pose;
        None where none do."""
        if not self.robot.actuators:
            return None
        if self.live is not None:
            return self.live.forces
        if self.following and self.replay is not None:
            return self.replay.forces_at(self.player.time)
        try:
            return np.asarray(
                self.robot.inverse_dynamics(self.state, np.zeros(self.robot.mobility))
            )
        except LinkworkError:
            return None

    def arrows(self, kind: str, u: np.ndarray | None) -> ArrowLines:
        """Return the arrows of one kind, the largest of the run (or, while posing, of the pose)
        drawn in full.

        kind: one of `KINDS`; u: forces of the actuators [N, N m], None where there are none.
        """
        vectors = self.of_kind(kind, self.state, u)
        largest = self.largest[kind] if self.following else vectors.largest()
        return drawn(vectors, largest, self.parts.size)

    def of_kind(self, kind: str, state: State, u: np.ndarray | None) -> Arrows:
        """Return the vectors of one kind; none where they are not defined
        (a singular configuration).

        kind, u: as of `arrows`; state: one of the robot.
        """
        try:
            if kind == "velocities":
                return self.vectors.velocities(state)
            if kind == "actuator forces":
                return NOTHING if u is None else self.vectors.forces(state, u)
            return self.vectors.reactions(state, np.zeros(0) if u is None else u)
        except LinkworkError:
            return NOTHING
