"""Studies: which robots, starts, forces and controllers are simulated, and what is kept of the
runs.

A study is a YAML file with the fields of `Study`; its first line is `study: 1`. Units are SI,
angles are in radians.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import chain, islice, product
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from linkwork.checks import MOST, file_path
from linkwork.control.described_drives import drive
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.mechanism.document import DocumentNode, read_document
from linkwork.mechanism.files import described, text_of
from linkwork.mechanism.numbers import edited, free_numbers
from linkwork.mechanism.record import MechanismError, Name, PathName, Positive, Real, Record
from linkwork.mechanism.refusal import PLAIN, shown
from linkwork.runs.members import of_elements
from linkwork.runs.settings import Settings
from linkwork.simulation import METHODS, integrator
from linkwork.sweeps.controllers import AnyController
from linkwork.sweeps.designs import AnyDesign, AnyVariation, Grid
from linkwork.sweeps.outputs import Output, require_quantity
from linkwork.sweeps.study_robot import require_known, with_robot

FORMAT_VERSION = 1
MAX_BYTES = 1_000_000
NUMBERS_AT_ONCE = (
    2_000_000  # of one quantity of a chunk, where the study does not say how long chunks are
)
CORNERS = 256  # of what varies beside a number, with which it is tried
CHUNKS = (16, 4096)  # members of the shortest and the longest chunk then
OWN = ("start", "forces", "controllers", "drives")
TAKEN = (
    *("member", "time", "chunk", "checksum", "status", "end_time", "nfev", "pivot"),
    *("closure_error", "controller", "coordinate", "rate", "actuator", "joint", "pose", "extra"),
)


class StudyError(MechanismError):
    """Refuse a study, or say why it cannot go on, in one sentence."""


class Start(Record):
    """Say where runs start: at a tool pose, at joint coordinates (with a tool pose they choose the
    branch), with rates."""

    tool: tuple[Real, ...] | None = Field(default=None, description="pose of the tool [m, rad]")
    joints: Mapping[PathName, Real] = Field(
        default_factory=dict, description="joint coordinates by name [m, rad]"
    )
    rates: Mapping[PathName, Real] = Field(
        default_factory=dict, description="rates by name [m/s, rad/s]"
    )


class Study(Record):
    """Describe a study.

    What varies is named by the path of a number of the robot ("platform.mass"), or by its place
    here: "start.tool.x", "start.joints.slide_1", "start.rates.slide_1", "forces.slide_1",
    "controllers.NAME.kp", "drives.slide_1.resistance". Each controller is tried with every point of
    the design.

    Raises:
        MechanismError: one sentence that names the element, the value and what would be accepted.
    """

    name: str = Field(default="study", description="name of the study")
    robot: Mechanism = Field(description="a robot of the catalogue, or a mechanism file")
    reference: Mapping[PathName, Real] = Field(
        default_factory=dict,
        description="joint coordinates in place of those of the robot's own reference [m, rad]",
    )
    duration: Positive = Field(description="length of each run [s]")
    samples: Annotated[int, Field(ge=2, le=MOST), PLAIN] = Field(
        default=101, description="number of equally spaced times looked at"
    )
    start: Start = Field(default=Start(), description="where runs start")
    forces: Mapping[PathName, Real] = Field(
        default_factory=dict, description="constant actuator forces [N, N m]"
    )
    controllers: Mapping[Name, AnyController] = Field(
        default_factory=dict, description="controllers by name"
    )
    drives: Mapping[PathName, Mapping[str, float | str]] = Field(
        default_factory=dict, description="drives by actuator, each a type and its numbers"
    )
    design: AnyDesign = Field(default=Grid(), description="a design: grid, random or sobol")
    vary: Mapping[str, AnyVariation] = Field(description="what varies, by name")
    outputs: Mapping[Name, str] = Field(
        description="outputs by name, each a reduction and a quantity"
    )
    trajectories: tuple[str, ...] = Field(default=(), description="quantities to keep at all times")
    method: str | None = Field(default=None, description="integration method")
    step: Positive | None = Field(default=None, description="step of a method of fixed step [s]")
    rtol: Annotated[Positive, Field(lt=1)] = Field(
        default=Settings.rtol, description="relative tolerance, below 1"
    )
    atol: Positive = Field(
        default=Settings.atol,
        description="absolute tolerance [rad; of lengths parts of the robot's own length]",
    )
    max_steps: Annotated[int, Field(ge=1), PLAIN] = Field(
        default=Settings.max_steps, description="most steps of a run"
    )
    on_singular: Literal["stop", "step_over"] = Field(
        default="stop", description="stop or step_over"
    )
    chunk: Annotated[int, Field(ge=1), PLAIN] | None = Field(
        default=None, description="members that are computed at a time"
    )

    @field_validator("vary", "outputs")
    @classmethod
    def _some(cls, given: Mapping[str, Any]) -> Mapping[str, Any]:
        if not given:
            raise MechanismError("is empty; name at least one")
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        # Outputs and trajectories: readable, each name once.
        taken = (*TAKEN, *self.trajectories, *self.varied)
        for name, text in self.outputs.items():
            if name in taken or "/" in name:
                raise MechanismError(
                    "is the name of something else, or holds a '/'; choose another",
                    ("outputs", name),
                )
            with_place(Output.read, text, ("outputs", name))
        for index, name in enumerate(self.trajectories):
            with_place(require_quantity, name, ("trajectories", str(index)))
        # What is varied suits the design.
        for name, variation in self.vary.items():
            fault = self.design.refuse(name, variation)
            if fault:
                raise MechanismError(f"is {variation.type!r}, but {fault}", ("vary", name))
        for name in self.varied:
            if "/" in name or not name.isprintable():
                raise MechanismError(
                    f"{shown(name)} cannot be varied: its name holds a '/'", ("vary", name)
                )
            if self.varied.count(name) > 1:
                raise MechanismError(f"{name!r} varies twice; keep one of them", ("vary", name))
        # What acts.
        if self.controllers and (
            self.forces or any(name.startswith("forces.") for name in self.varied)
        ):
            raise MechanismError("and controllers are both given; keep one of them", ("forces",))
        for actuator, numbers in self.drives.items():
            drive(numbers, ("drives", actuator))
        # How it is integrated, and where it starts.
        try:
            integrator(self.method, self.step)
        except LinkworkError as error:
            raise MechanismError(
                str(error), ("step" if self.method in (*METHODS, None) else "method",)
            ) from None
        with_place(self.robot.with_reference, self.reference, ("reference",))
        self._check_paths()
        self._check_acting()
        return self

    def _check_paths(self) -> None:
        """Refuse paths that lead to no number, and values that no description may hold whatever
        varies beside them in the same body, joint or other element."""
        for name in self.paths:
            with_place(lambda path: free_numbers(self.robot, [path]), name, self.place(name))
        with_place(lambda paths: free_numbers(self.robot, paths), self.paths, ("vary",))
        groups = of_elements(self.robot, self.paths)
        for name, variation in self.vary.items():
            own = [path for path in self._named(name) if path in self.paths]
            beside = {self.place(path)[1] for each in groups if {*own} & {*each} for path in each}
            for value in variation.bounds:
                reached = f"reaches {value:.6g}, which the robot may not have: "
                values = dict.fromkeys(own, value)
                with_place(
                    lambda given: self._possible(*given),
                    (values, sorted(beside - {name})),
                    ("vary", name),
                    reached,
                )

    def _possible(self, values: Mapping[str, float], beside: Sequence[str]) -> None:
        """Refuse values by path that the robot may not have with its own other numbers, nor with
        any bounds of what varies beside them."""
        refusal, corners = None, product(*(self.vary[name].bounds for name in beside))
        for corner in chain([()], islice(corners if beside else (), CORNERS)):
            others = {
                path: number
                for name, number in zip(beside, corner, strict=False)
                for path in self._named(name)
                if path in self.paths
            }
            try:
                edited(self.robot, {**others, **values})
                return
            except MechanismError as error:
                refusal = error
        if refusal:
            raise refusal

    def _check_acting(self) -> None:
        """Refuse bounds of the numbers of a controller or a drive that it may not have together."""
        for what, section, numbers, make in self._acting():
            own = {f"{section}.{number}": number for number in numbers}
            varied = [name for name in self.vary if {*own} & {*self._named(name)}]
            corners = product(*(self.vary[name].bounds for name in varied)) if varied else ()
            for corner in islice(corners, CORNERS):
                values = {
                    own[each]: value
                    for name, value in zip(varied, corner, strict=True)
                    for each in self._named(name)
                    if each in own
                }
                told = ", ".join(f"{value:.6g}" for value in corner)
                reached = f"reaches {told}, which the {what} may not have: "
                with_place(make, values, ("vary", varied[-1]), reached)

    def _named(self, name: str) -> tuple[str, ...]:
        """Return all names that take the values of a variation."""
        return name, *self.vary[name].also

    def _acting(self) -> Iterator[tuple[str, str, Iterable[str], Callable[..., Any]]]:
        """Yield of each controller and drive which of both it is, its place, its numbers, and what
        makes it with other values of some of them."""
        for name, given in self.controllers.items():
            yield "controller", f"controllers.{name}", given.numbers, given.but
        for name, given in self.drives.items():
            numbers = drive(given, ()).numbers
            yield "drive", f"drives.{name}", numbers, lambda x, of=given: drive({**of, **x}, ())

    @cached_property
    def mechanism(self) -> Mechanism:
        """The robot about the reference that the study gives."""
        return self.robot.with_reference(self.reference) if self.reference else self.robot

    def place(self, name: str) -> tuple[str, ...]:
        """Return where a varied name stands in the study."""
        return "vary", next(
            key for key, variation in self.vary.items() if name in (key, *variation.also)
        )

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """The names of all that varies, in the order of the file."""
        return tuple(
            name for key, variation in self.vary.items() for name in (key, *variation.also)
        )

    @cached_property
    def columns(self) -> tuple[int, ...]:
        """The column of the design's points that each of `varied` has."""
        return tuple(
            i for i, variation in enumerate(self.vary.values()) for _ in (0, *variation.also)
        )

    @property
    def paths(self) -> tuple[str, ...]:
        """Those of `varied` that are numbers of the robot."""
        return tuple(name for name in self.varied if name.partition(".")[0] not in OWN)

    @property
    def points(self) -> int:
        """Number of points of the design."""
        return self.design.count(tuple(self.vary.values()))

    @property
    def members(self) -> int:
        """Number of runs: every point with every controller, the controller varying fastest."""
        return self.points * max(len(self.controllers), 1)

    @property
    def chunk_length(self) -> int:
        """Number of members that are computed and written at a time."""
        least, most = CHUNKS
        return min(
            self.chunk or max(least, min(most, NUMBERS_AT_ONCE // self.samples)), self.members
        )

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.members // self.chunk_length)

    @cached_property
    def text(self) -> str:
        """All that the results depend on, as JSON."""
        return self.model_dump_json()

    @cached_property
    def digest(self) -> str:
        """What tells studies apart."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @classmethod
    def load(cls, path: str | Path) -> Study:
        """Read a study from a YAML file; refusals name the file and the line."""
        path = file_path(path, "the path of a study")
        with in_file(path):
            return _study(read_document(_text(path)), path.parent)


@contextmanager
def in_file(path: Path) -> Iterator[None]:
    """Name the file, and the line of the element, in a refusal of what stands there."""
    try:
        yield
    except MechanismError as error:
        place = error.place
        if error.where and not place:
            place = f"line {read_document(_text(path)).line_of(error.where)}"
        raise StudyError(
            error.what, error.where, f"{path}: {place}" if place else str(path)
        ) from None


def with_place(check: Any, value: Any, where: tuple[str, ...], before: str = "") -> None:
    """Check a value; say in a refusal where it stands."""
    try:
        check(value)
    except MechanismError as error:
        path = f"{'.'.join(error.where)}: " if error.where and before else ""
        raise MechanismError(f"{before}{path}{error.what}", where) from None


def _text(path: Path) -> str:
    return text_of(path, "a study", MAX_BYTES)


def _study(root: DocumentNode, folder: Path) -> Study:
    def make(**fields: Any) -> Study:
        require_known(fields, tuple(Study.model_fields))
        return Study(**with_robot(fields, folder))

    return described(root, "study", FORMAT_VERSION, "study", make)
