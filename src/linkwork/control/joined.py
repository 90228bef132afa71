"""The equations of motion in one chart, joined with what acts: the functions that a run is
integrated with.

    q' = N L v,    M v' = S' u + sum_i T_i' w_i - (C v + G - f),    z' = f_z  inputs (q, v, z, r, p)

u, w_i and z' are those of `Acting`, at the quantities of this chart. The integrator's inputs r are
(t, references, held).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.control.acting import OUTPUTS, Acting
from linkwork.control.continued import continued
from linkwork.control.drives import Ideal
from linkwork.control.observation import expression
from linkwork.equations import Equations, bearings, uncharted
from linkwork.equations.functions import of_inputs
from linkwork.equations.powers import contact_terms, power_terms

DIRECTION = "d"  # the input of a derivative along a direction
WRITTEN_OUT = 50_000
"""Columns of a Jacobian times instructions of the motion up to which it is one straight-line
program."""


@dataclass(frozen=True, eq=False)
class Joined:
    """Join equations in one chart with what acts on the robot."""

    equations: Equations
    acting: Acting

    @classmethod
    def of(cls, equations: Equations, acting: Acting) -> Joined:
        """Join equations in one chart with what acts; the states of bristles become symbols."""
        return cls(equations.strained, acting)

    @cached_property
    def inputs(self) -> dict[str, ca.SX]:
        """Symbols of the kernels' inputs: q, v, z, r, p."""
        function = self.acting.function
        p = ca.SX.sym("p", function.numel_in("parameters"))
        strained = ca.vertcat(ca.SX(0, 1), *self.equations.strains.values())
        count = int(self.acting.timed) + function.numel_in("references") + function.numel_in("held")
        return {
            "q": self.equations.tree.q,
            "v": self.equations.v,
            "z": ca.vertcat(
                ca.SX.sym("z", function.numel_in("extras") - strained.numel()),
                strained,
                ca.SX.sym("followed", sum(map(len, self.acting.followed))),
            ),
            "r": ca.SX.sym("r", count),
            "p": ca.vertcat(self.equations.p, p),
        }

    @cached_property
    def outputs(self) -> dict[str, ca.SX]:
        """What acts, by the names of `Acting`'s outputs, in this chart's symbols; wrenches in the
        ground's axes."""
        function, timed, (_, _, z, r, p) = (
            self.acting.function,
            int(self.acting.timed),
            self.inputs.values(),
        )
        # What acts, for the quantities of this chart.
        held = function.numel_in("held")
        extras = function.numel_in("extras")
        followed = [*continued(self.equations, self.acting.followed, z[extras:])]
        known = {name: value[i] for names, value, _ in followed for i, name in enumerate(names)}
        values = [
            known[quantity.name]
            if quantity.kind == "position" and quantity.name in known
            else self.unknown[quantity.name]
            if quantity.kind == "load"
            else expression(self.equations, quantity)
            for quantity in self.acting.quantities
        ]
        references = r[timed : r.numel() - held]
        own = p[self.equations.p.numel() :]
        found = function(
            r[0] if timed else 0, references, r[r.numel() - held :], z[:extras], own, *values
        )
        outputs = dict(zip(OUTPUTS, found, strict=True))
        # Wrenches in the ground's axes.
        parts = ca.vertsplit(outputs["wrenches"], 6) if self.acting.wrenches else []
        in_ground = [
            w.in_ground(self.equations, part)
            for w, part in zip(self.acting.wrenches, parts, strict=True)
        ]
        # The rates of all states z: of what acts, of bristles, of turns.
        rates = [outputs["extra_rates"], self.equations.strain_rates]
        rates += [rate for *_, rate in followed]
        return outputs | {
            "wrenches": ca.vertcat(ca.SX(0, 1), *in_ground),
            "extra_rates": ca.vertcat(*rates),
        }

    @cached_property
    def applied(self) -> ca.SX:
        """The forces of actuators and wrenches on the rates v (n)."""
        equations = self.equations
        applied = ca.mtimes(equations.actuation.T, self.outputs["force"])
        parts = ca.vertsplit(self.outputs["wrenches"], 6) if self.acting.wrenches else []
        for wrench, part in zip(self.acting.wrenches, parts, strict=True):
            applied += wrench.on_rates(equations, part)
        return applied

    @cached_property
    def accelerations(self) -> ca.SX:
        """The accelerations v' (n)."""
        force = self.outputs["force"]
        return bearings.accelerations(self.equations, self.applied, force, self.outside)

    @property
    def outside(self) -> tuple[tuple[str, ca.SX], ...]:
        """The wrenches on bodies about their mass centres, in the ground's axes."""
        parts = ca.vertsplit(self.outputs["wrenches"], 6) if self.acting.wrenches else []
        return tuple(
            wrench.about_centre(self.equations, part)
            for wrench, part in zip(self.acting.wrenches, parts, strict=True)
        )

    @cached_property
    def derivatives(self) -> ca.SX:
        """y' = (q', v', z')."""
        q_dot = self.equations.tree.derivatives(self.equations.rates)
        return ca.vertcat(q_dot, self.accelerations, self.outputs["extra_rates"])

    @property
    def defined(self) -> ca.SX:
        """1; nan where a drive might hide that its command is no finite number."""
        commands = ca.vertsplit(self.outputs["command"])
        driven = [
            c
            for c, drive in zip(commands, self.acting.drives, strict=True)
            if not isinstance(drive, Ideal)
        ]
        if not driven:
            return ca.SX(1)
        return ca.if_else(ca.norm_1(ca.vertcat(*driven)) < ca.inf, 1, np.nan)

    def motion(self) -> ca.Function:
        """Return (q, v, z, r, p) -> y' and the weakest relative pivot, undefined where a command
        that is driven with is."""
        pivot = self.equations.elimination.pivot * self.defined
        return self._function("system", {"derivatives": self.derivatives, "pivot": pivot})

    def balance(self) -> ca.Function:
        """Return (q, w, z, r, p) -> what `uncharted.balance` gives, z', and `defined`; the rates v
        have to be those of the whole tree."""
        outputs = uncharted.balance(self.equations, self.applied)
        more = {"extra_rates": self.outputs["extra_rates"], "defined": self.defined}
        return self._function("balance", outputs | more)

    def slopes(self) -> ca.Function:
        """Return (q, w, z, r, p, a, l, d) -> the derivative of q', of what `uncharted.unbalanced`
        gives at a and l, and of z', along a direction d of (q, w, z, r); as `balance`."""
        *state, _ = self.inputs.values()
        a, multipliers = (
            ca.SX.sym(name, size)
            for name, size in (("a", self.equations.nv), ("l", len(self.equations.rows.names)))
        )
        found = uncharted.unbalanced(self.equations, self.applied, a, multipliers)
        parts = found["derivatives"], found["forces"], self.outputs["extra_rates"], found["gamma"]
        given = ca.vertcat(*state)
        d = ca.SX.sym("d", given.numel())
        along = ca.jtimes(ca.densify(ca.vertcat(*parts)), given, d)
        inputs = self.inputs | {"a": a, "l": multipliers, DIRECTION: d}
        return of_inputs("slopes", inputs, {"along": along})

    def jacobian(self) -> ca.Function:
        """Return (q, v, z, r, p) -> df/dy and df/dr, column by column."""
        q, v, z, r, _ = self.inputs.values()
        f = ca.densify(self.derivatives)
        return self._function(
            "jacobian", {"f_y": ca.jacobian(f, ca.vertcat(q, v, z)), "f_r": ca.jacobian(f, r)}
        )

    def tangent(self) -> ca.Function:
        """Return (q, v, z, r, p, d) -> the derivative of y' along a direction d of (q, v, z, r)."""
        *state, _ = self.inputs.values()
        given = ca.vertcat(*state)
        d = ca.SX.sym("d", given.numel())
        along = ca.jtimes(ca.densify(self.derivatives), given, d)
        return of_inputs("tangent", self.inputs | {DIRECTION: d}, {"along": along})

    def derivative(self) -> ca.Function:
        """Return `tangent` where the Jacobian is large, else `jacobian`."""
        return self.tangent() if self.large else self.jacobian()

    @cached_property
    def large(self) -> bool:
        """Whether the Jacobian is too large to be written out: its columns come of `tangent`."""
        columns = sum(x.numel() for x in [*self.inputs.values()][:-1])
        return columns * self.motion().n_instructions() > WRITTEN_OUT

    def events(self) -> ca.Function:
        """Return (q, v, z, r, p) -> the numbers whose zeros are the events."""
        loads, least = self.loads
        return self._function("events", {"g": self.passing(loads * (ca.fabs(loads) > least))})

    def held(self) -> ca.Function:
        """Return (q, v, z, r, p) -> the next held inputs of a sampled controller."""
        return self._function("held", {"held": self.outputs["next_held"]})

    def recorded(self) -> ca.Function:
        """Return (q, v, z, r, p) -> v' and what `acted` gives."""
        return self._function("recorded", {"dv": self.accelerations} | self._acted)

    def acted(self) -> ca.Function:
        """Return (q, v, z, r, p) -> command, force and wrenches (moment, force) in the ground's
        axes."""
        return self._function("acted", self._acted)

    @cached_property
    def unknown(self) -> dict[str, ca.SX]:
        """Symbols for the loads that events read, which follow from all that acts."""
        read = (quantity for quantity in self.acting.quantities if quantity.kind == "load")
        return {quantity.name: ca.SX.sym("load") for quantity in read}

    @cached_property
    def loads(self) -> tuple[ca.SX, ca.SX]:
        """The loads themselves, in the order of `unknown`, and below which size they are
        rounding."""
        if not self.unknown:
            return ca.SX(0, 1), ca.SX(0)
        force = self.outputs["force"]
        found, least = bearings.line_loads(self.equations, self.applied, force, self.outside)
        return ca.vertcat(*(found[name] for name in self.unknown)), least

    def passing(self, loads: ca.SX | None = None) -> ca.SX:
        """Return the numbers whose zeros are the events; loads: in place of those that act."""
        g, unknown = self.outputs["events"], ca.vertcat(ca.SX(0, 1), *self.unknown.values())
        return ca.substitute(g, unknown, self.loads[0] if loads is None else loads)

    @property
    def _acted(self) -> dict[str, ca.SX]:
        return {name: self.outputs[name] for name in ("command", "force", "wrenches")}

    def powers(self) -> ca.Function:
        """Return (q, v, z, r, p) -> what `power_terms` gives."""
        force = self.outputs["force"]
        borne = bearings.friction_in_motion(self.equations, self.applied, force, self.outside)
        return self._function("powers", power_terms(self.equations, borne))

    def contacts(self) -> ca.Function:
        """Return (q, v, z, r, p) -> what `contact_terms` gives."""
        return self._function("contacts", contact_terms(self.equations))

    def _function(self, name: str, outputs: dict[str, ca.SX]) -> ca.Function:
        return of_inputs(name, self.inputs, outputs)
