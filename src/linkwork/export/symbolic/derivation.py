"""From a robot to its closed forms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import sympy

from linkwork.errors import LinkworkError
from linkwork.export.symbolic import dynamics
from linkwork.export.symbolic.chain import Chain
from linkwork.export.symbolic.closed import ClosedForms
from linkwork.export.symbolic.complement import Complement
from linkwork.export.symbolic.dimensions import Dimensions
from linkwork.export.symbolic.elimination import Key, RateRow, SolvedTogether, steps_of
from linkwork.export.symbolic.exact import VALUES
from linkwork.export.symbolic.forms import FormulaSection
from linkwork.export.symbolic.lettering import Letters, dimension_symbols
from linkwork.export.symbolic.loops import LoopRow, loop_rows, own_coordinates
from linkwork.export.symbolic.trig import ONE, ZERO, Trig
from linkwork.export.symbolic.written import Writer
from linkwork.mechanism.numbers import located
from linkwork.robot import Robot

SymbolsOf = Literal["free", "all"]
MOST = 6000  # operations that are printed
EACH = 4  # operations at least of a term, counted
RANK = 1e-9
AGREEING = 1e-9  # largest relative difference from the kernels at the robot's home


@dataclass
class Derivation:
    """Derive closed forms; what is named on the way is collected in sections."""

    robot: Robot
    every: bool
    letters: Letters = field(default_factory=Letters)
    sections: list[FormulaSection] = field(default_factory=list)

    def __post_init__(self) -> None:
        robot = self.robot
        dynamics.refuse_others(robot.equations)
        refuse_turns(robot)
        self.dimensions = Dimensions(robot.mechanism, robot.parameters, self.every)
        topology, flat = robot.equations.topology, robot.planar
        self.chain = Chain(robot.mechanism, topology, self.dimensions, flat)
        self.chain.grow()
        self.labels = own_coordinates(robot.equations, flat)
        self.home = dict(zip(robot.coordinates, robot.home.positions.tolist(), strict=True))
        self.free = robot.independent
        self.numbers = {label: place for place, label in enumerate(self.labels, start=1)}

    def forms(self) -> ClosedForms:
        """Return the closed forms."""
        # Everything that is a polynomial: phi, Phi, gamma, H, h, w.
        rows = self.kept(loop_rows(self.chain, self.robot.equations, self.home))
        Phi = {
            (i, label): value
            for i, row in enumerate(rows)
            for label in self.labels
            if (value := dynamics.derivative(row.phi, label))
        }
        gammas = {i: gamma for i in range(len(rows)) if (gamma := self.gamma(Phi, i))}
        H = dynamics.inertia(self.chain, self.labels)
        self.refuse_long([row.phi for row in rows], Phi.values(), H.values())
        h = dynamics.inertia_forces(H, self.labels)
        w = dynamics.weights(self.chain, self.labels)
        self.refuse_long(gammas.values(), H.values(), h.values(), w.values())
        steps = self.steps(rows, Phi)
        # From here on in symbols.
        self.name([*Phi.values(), *(row.phi for row in rows), *H.values(), *w.values()])
        return self.assembled(rows, Phi, self.solved(steps, gammas), (H, h, w))

    def gamma(self, Phi: Mapping[tuple[int, str], Trig], row: int) -> Trig:
        """Return what is left of phi'' at q'' = 0."""
        total = ZERO
        for (i, j), value in Phi.items():
            if i == row:
                for k in self.labels:
                    if slope := dynamics.derivative(value, k):
                        total += slope * dynamics.rate(j) * dynamics.rate(k)
        return total

    def kept(self, rows: Sequence[LoopRow]) -> list[LoopRow]:
        """Return as many rows as there are dependent coordinates, the first independent ones."""
        wanted = len(self.labels) - len(self.free)
        values = dict(VALUES) | {f"q:{label}": x for label, x in self.home.items()}
        values |= self.dimensions.found
        angles = {
            label: self.home[label] + phase.value(VALUES, {})
            for label, (_, phase) in self.chain.angles.items()
        }
        found: list[LoopRow] = []
        matrix = np.zeros((0, len(self.labels)))
        for row in rows:
            slopes = (dynamics.derivative(row.phi, label) for label in self.labels)
            one = np.array([[slope.value(values, angles) for slope in slopes]])
            more = np.vstack([matrix, one])
            s = np.linalg.svd(more, compute_uv=False)
            if len(s) == len(more) and s[-1] > RANK * s[0]:
                found, matrix = [*found, row], more
        if len(found) != wanted:
            raise LinkworkError(
                f"at its home {self.robot.mechanism.name} has {len(found)} independent loop "
                f"equations for {wanted} dependent rates; give it a reference configuration that "
                "is not singular"
            )
        return found

    def steps(
        self, rows: Sequence[LoopRow], Phi: Mapping[tuple[int, str], Trig]
    ) -> list[SolvedTogether]:
        """Return the steps that solve for the dependent rates; those of joints that close loops are
        taken out first."""
        dependent = [label for label in self.labels if label not in self.free]
        own = []
        for i in range(len(rows)):
            left = {label: Phi[i, label] for label in dependent if (i, label) in Phi}
            right: dict[Key, Trig] = {
                ("rate", label): -Phi[i, label] for label in self.free if (i, label) in Phi
            }
            own.append(RateRow(left, right | {("gamma", str(i)): -ONE}))
        closing = {
            label
            for name, joint in self.robot.equations.topology.closing.items()
            for label in joint.coordinates(name)
        }
        return steps_of(own, [label for label in dependent if label in closing])

    # Symbols

    def name(self, every: Iterable[Trig]) -> None:
        """Make the symbols of coordinates, rates and dimensions."""
        used = {key for each in every for key in each.symbols}
        letters, symbols = self.letters, {}
        for label, place in self.numbers.items():
            unit = self.robot.unit(label)
            meaning = f"coordinate of {label} [{unit}]"
            symbols[f"q:{label}"] = letters.symbol(f"q_{place}", f"q_{{{place}}}", meaning)
            symbols[f"w:{label}"] = letters.symbol(f"dq_{place}", f"\\dot q_{{{place}}}")
        known = [key for key in self.dimensions.found if key in used]
        self.of_dimensions = dimension_symbols(letters, self.dimensions, known)
        self.symbols = symbols | self.of_dimensions
        self.writer = Writer(self.symbols, self.chain.angles, self.every)
        angles = {}
        for label, place in self.numbers.items():
            if label in self.chain.angles and (phase := self.chain.angles[label][1]):
                theta = letters.numbered("theta", place, latex="\\theta")
                self.symbols[f"theta:{label}"] = theta
                angles[theta] = symbols[f"q:{label}"] + self.write(phase)
        self.section("Angles", angles)

    def write(self, x: Trig) -> sympy.Expr:
        return self.writer.expression(x)

    def section(self, title: str, equations: Mapping[sympy.Symbol, sympy.Expr]) -> None:
        """Keep equations that belong together."""
        if equations:
            self.sections.append(FormulaSection(title, dict(equations)))

    def solved(self, steps: Sequence[SolvedTogether], gammas: Mapping[int, Trig]) -> Complement:
        """Return L and b, in symbols that are defined in sections."""
        names = {i: self.letters.numbered("gamma", i + 1, latex="\\gamma") for i in gammas}
        found = Complement(self.letters, self.writer, self.free, self.numbers, names)
        for count, step in enumerate(steps, start=1):
            found.add(step, count)
        self.section("Elements of the dependent rates' equations", found.shared)
        self.section("Orthogonal complement", found.own_L)
        rates = {
            self.symbols[f"w:{label}"]: sympy.Add(
                *[
                    found.L[label, k] * self.symbols[f"w:{k}"]
                    for k in self.free
                    if (label, k) in found.L
                ]
            )
            for label in self.labels
            if label not in self.free
        }
        self.section("Rates", rates)
        bias = {names[i]: self.write(x) for i, x in gammas.items()}
        self.section("Bias of the loop equations", bias)
        self.section("Bias of the accelerations", found.own_b)
        return found

    # Everything joined

    def assembled(
        self,
        rows: Sequence[LoopRow],
        Phi: Mapping[tuple[int, str], Trig],
        complement: Complement,
        tree: tuple[Mapping[tuple[str, str], Trig], Mapping[str, Trig], Mapping[str, Trig]],
    ) -> ClosedForms:
        """Return M, C v and G with all that they are made of."""
        (H, h, w), L, b = tree, complement.L, complement.b
        letters, number, labels = self.letters, self.numbers, self.labels
        elements = {
            (j, k): letters.numbered("H", number[j], number[k])
            for j, k in H
            if number[j] <= number[k]
        }
        self.section(
            "Inertia of the tree", {name: self.write(H[place]) for place, name in elements.items()}
        )
        both = elements | {(k, j): name for (j, k), name in elements.items()}
        forces = {label: letters.numbered("h", number[label]) for label in h}
        self.section(
            "Inertia forces of the tree", {forces[label]: self.write(x) for label, x in h.items()}
        )
        weight = {label: letters.numbered("w", number[label]) for label in w}
        self.section("Weight", {weight[label]: self.write(x) for label, x in w.items()})
        # c = h + H b, then the projections by L.
        moved: dict[str, sympy.Expr] = {}
        own_c: dict[sympy.Symbol, sympy.Expr] = {}
        for label in labels:
            value = forces.get(label, sympy.Integer(0)) + sympy.Add(
                *[both[label, k] * b[k] for k in labels if (label, k) in both and k in b]
            )
            if value != 0:
                moved[label] = complement.name("c", (number[label],), value, own_c)
        self.section("Inertia forces at v' = 0", own_c)

        def projected(values: Mapping[str, sympy.Expr], k: str) -> sympy.Expr:
            return sympy.Add(*[L[i, k] * x for i, x in values.items() if (i, k) in L])

        def inertia(k: str, other: str) -> sympy.Expr:
            return sympy.Add(
                *[
                    L[i, k] * name * L[j, other]
                    for (i, j), name in both.items()
                    if (i, k) in L and (j, other) in L
                ]
            )

        # All matrices by what they are made of, unless they are too long to read.
        n, free = len(self.free), self.free
        matrices = {
            "phi": sympy.Matrix([self.write(row.phi) for row in rows]),
            "Phi": self.matrix(len(rows), labels, Phi),
            "L": sympy.Matrix(len(labels), n, lambda i, k: L.get((labels[i], free[k]), 0)),
            "M": sympy.Matrix(n, n, lambda i, k: inertia(free[min(i, k)], free[max(i, k)])),
            "Cv": sympy.Matrix(n, 1, lambda i, _: projected(moved, free[i])),
            "G": sympy.Matrix(n, 1, lambda i, _: projected(weight, free[i])),
        }
        expressions = [x for part in self.sections for x in part.equations.values()]
        operations = int(sympy.count_ops([*expressions, *matrices.values()]))
        if operations > MOST:
            raise self.too_long(operations)
        # What was found, with its letters and their meanings.
        found = self.dimensions.found
        return ClosedForms(
            name=self.robot.mechanism.name,
            coordinates={label: self.symbols[f"q:{label}"] for label in labels},
            rates={label: self.symbols[f"w:{label}"] for label in labels},
            independent=tuple(free),
            parameters={symbol: found[key] for key, symbol in self.of_dimensions.items()},
            meanings=self.letters.meanings,
            sections=tuple(self.sections),
            rows=tuple(row.name for row in rows),
            letters=self.letters.latex,
            operations=operations,
            **matrices,
        )

    def matrix(
        self, rows: int, labels: Sequence[str], values: Mapping[tuple[int, str], Trig]
    ) -> sympy.Matrix:
        elements = [self.write(values.get((i, x), ZERO)) for i in range(rows) for x in labels]
        return sympy.Matrix(rows, len(labels), elements)

    def refuse_long(self, *parts: Iterable[Trig]) -> None:
        """Refuse polynomials that have more terms than operations are printed."""
        terms = sum(len(x.terms) for part in parts for x in part)
        if EACH * terms > MOST:
            raise self.too_long(EACH * terms)

    def too_long(self, operations: int) -> LinkworkError:
        return LinkworkError(
            f"the closed forms of {self.robot.mechanism.name} take {operations} operations and "
            f"more, which nobody reads; at most {MOST} are printed: export it as C or CasADi "
            "functions"
        )


def derived(robot: Robot, symbols: SymbolsOf = "free") -> ClosedForms:
    """Return a robot's closed forms, compared with its kernels at home; symbols: of the free
    numbers, or of all."""
    forms = Derivation(robot, symbols == "all").forms()
    state = robot.state(robot.home.positions, np.ones(robot.mobility))
    own = [robot.coordinates.index(name) for name in forms.coordinates]
    found = forms.evaluate(state.positions[own], state.rates)
    expected = {
        "L": robot.rate_map(state)[[robot.rates.index(name) for name in forms.rates]],
        "M": robot.mass_matrix(state),
        "Cv": robot.coriolis(state),
        "G": robot.gravity(state),
    }
    size = AGREEING * max(1.0, float(np.abs(expected["M"]).max(initial=0.0)))
    for name, values in expected.items():
        if not np.allclose(found[name], values, rtol=AGREEING, atol=size):
            error = float(np.abs(found[name] - values).max())
            raise LinkworkError(
                f"the closed form of {name} of {robot.mechanism.name} differs from its kernel by "
                f"{error:.3g} at home, so it is not printed; use robot's own methods, or export C"
            )
    return forms


def refuse_turns(robot: Robot) -> None:
    """Refuse free rotations, which would make every direction a polynomial of its own, and free
    quantities, whose formulas stand for many numbers."""
    for path in robot.parameters:
        where = located(robot.mechanism, path)[0]
        if where[0] == "let":
            raise LinkworkError(
                f"{path!r} is a named quantity, and equations are printed of numbers that are free "
                "themselves; free those, or use robot.functions()"
            )
        if any(part in ("rotation", "turn") for part in where[2:]):
            raise LinkworkError(
                f"{path!r} turns a frame, and equations are printed of frames that stay as they "
                "are; free positions, masses, inertias or gravity, or use robot.functions()"
            )
