"""Fluid power: pneumatic and hydraulic cylinders as drives; the command opens the valve, from -1 to
1.

Chamber A pushes towards larger joint coordinates, chamber B the other way. With the piston's travel
s = x - retracted:

    V_a = dead_volume + A_a s,    V_b = dead_volume + A_b (stroke - s),    s within 0 and stroke

A positive command leads the supply to A and B to the exhaust (or tank), a negative one the other
way round. At both ends of its stroke the piston meets a stop that gives way by d at the rate d',
and pushes back only, with the force

    F = k d max(1 + d' / 0.1 m/s, 0)

with k such that the supply presses the larger area `give` strokes deep.

Source of the stop: Hunt & Crossley, J. Applied Mechanics 42 (1975) 440-445.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from linkwork import math
from linkwork.control.drives import Drive, Extra
from linkwork.control.records import number
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Amount, Positive

LAMINAR = 0.999
"""Pressure ratio from which a small pneumatic flow is taken as proportional to the pressure
drop."""
DAMPED = 0.1  # rate at which a stop pushes back twice as hard as at rest [m/s]
BEYOND = 0.05  # of the stroke by which a piston may lie outside of it at the start of a run
NEAR_ZERO = 1e3  # pressure drop below which an orifice's flow is taken as proportional to it [Pa]


@dataclass(frozen=True)
class FluidCylinder(Drive):
    """Hold the geometry of a double-acting cylinder, and its supply and exhaust pressures."""

    area_a: float = number("effective area of the piston", "m^2", Positive)
    area_b: float = number("effective area of the piston", "m^2", Positive)
    stroke: float = number("", "m", Positive)
    supply: float = number("absolute pressure at the valve", "Pa", Positive)
    exhaust: float = number("absolute pressure at the valve", "Pa", Amount)
    initial_a: float = number("pressure of chamber A at the start", "Pa", Positive)
    initial_b: float = number("pressure of chamber B at the start", "Pa", Positive)
    dead_volume: float = number("of each chamber and its line", "m^3", Positive)
    retracted: float = number("joint coordinate at the retracted end", "m", default=0.0)
    give: float = number("how far the stops give way, of the stroke", "1", Positive, 1e-3)

    unit: ClassVar[str] = "1"

    @property
    def extras(self):
        return Extra("pressure_a", "Pa", self.initial_a), Extra("pressure_b", "Pa", self.initial_b)

    def require_start(self, x: float) -> None:
        travel = x - self.retracted
        if not -BEYOND * self.stroke <= travel <= (1 + BEYOND) * self.stroke:
            raise LinkworkError(
                f"the joint coordinate {x:g} m lies outside of the stroke of "
                f"{type(self).__name__}, which reaches from retracted = {self.retracted:g} m to "
                f"{self.retracted + self.stroke:g} m; start within it, or give another retracted"
            )

    def volumes(self, x: Any, w: Any) -> tuple[Any, Any, Any]:
        """Return V_a and V_b [m^3] at a joint coordinate, and the rate at which the travel changes
        them [m/s].

        x: [m]; w: [m/s].
        """
        travel = math.clip(x - self.retracted, 0, self.stroke)
        moving = w * (
            1
            - math.maximum(
                math.sign(math.abs(x - self.retracted - self.stroke / 2) - self.stroke / 2), 0
            )
        )
        return (
            self.dead_volume + self.area_a * travel,
            self.dead_volume + self.area_b * (self.stroke - travel),
            moving,
        )

    def stops(self, x: Any, w: Any) -> Any:
        """Return the force of the stops [N] at a joint coordinate and rate.

        x: [m]; w: [m/s].
        """
        stiffness = self.supply * math.maximum(self.area_a, self.area_b) / (self.give * self.stroke)
        travel = x - self.retracted
        low, high = math.maximum(-travel, 0), math.maximum(travel - self.stroke, 0)
        slow, fast = math.maximum(1 - w / DAMPED, 0), math.maximum(1 + w / DAMPED, 0)
        return stiffness * (low * slow - high * fast)


@dataclass(frozen=True)
class PneumaticCylinder(FluidCylinder):
    """Drive a slide by air through a proportional 5/3 valve.

        p_i' = (n / V_i) (R T m_i' - p_i V_i')
        F = p_a A_a - p_b A_b - atmosphere (A_a - A_b) + stops

    with the mass flows of a valve opened by |command|, from the pressure p_1 to p_2 (ISO 6358):

        m' = |command| C rho_0 p_1 sqrt(T_0 / T) psi(p_2 / p_1)
        psi(r) = 1 for r <= b, else sqrt(1 - ((r - b) / (1 - b))^2)

    Sources: ISO 6358-1; Beater, Pneumatic Drives, ch. 4 and 5.
    """

    conductance: float = number("C of the open valve", "m^3/(s Pa)", Amount, 2e-8)
    critical_ratio: float = number("b, at most 1", "1", Amount, 0.3)
    exponent: float = number("n, from 1 (isothermal) to 1.4 (adiabatic)", "1", Positive, 1.2)
    temperature: float = number("T of the air, with T_0 = 293.15 K", "K", Positive, 293.15)
    atmosphere: float = number("pressure on the rod's end", "Pa", Amount, 101325.0)

    type: ClassVar[str] = "pneumatic_cylinder"
    reference_temperature: ClassVar[float] = 293.15  # T_0 of ISO 8778 [K]
    gas_constant: ClassVar[float] = 287.058  # of dry air [J/(kg K)]
    # Of the reference atmosphere of ISO 8778, 100 kPa and 20 C at 65 % humidity [kg/m^3].
    density: ClassVar[float] = 1.185

    def __post_init__(self) -> None:
        super().__post_init__()
        if not math.symbolic(self.critical_ratio) and not self.critical_ratio <= 1:
            raise LinkworkError(
                f"critical_ratio of PneumaticCylinder is {self.critical_ratio:g}; give a ratio of "
                "pressures, at most 1"
            )

    def equations(self, command, x, w, z):
        opening, p_a, p_b = math.clip(command, -1, 1), z[0], z[1]
        V_a, V_b, w_in = self.volumes(x, w)
        filling, emptying = math.maximum(opening, 0), math.maximum(-opening, 0)
        m_a = filling * self.flow(self.supply, p_a) - emptying * self.flow(p_a, self.exhaust)
        m_b = emptying * self.flow(self.supply, p_b) - filling * self.flow(p_b, self.exhaust)
        heat = self.gas_constant * self.temperature
        force = (
            p_a * self.area_a - p_b * self.area_b - self.atmosphere * (self.area_a - self.area_b)
        )
        rates = (
            self.exponent / V_a * (heat * m_a - p_a * self.area_a * w_in),
            self.exponent / V_b * (heat * m_b + p_b * self.area_b * w_in),
        )
        return force + self.stops(x, w), rates

    def flow(self, first: Any, second: Any) -> Any:
        """Return the mass flow [kg/s] of the open valve from one pressure to another; backwards it
        is negative.

        first, second: both pressures [Pa].
        """
        upstream, downstream = math.maximum(first, second), math.minimum(first, second)
        ratio, b = downstream / upstream, self.critical_ratio
        past = math.maximum(math.minimum(ratio, LAMINAR) - b, 0)
        turbulent = math.sqrt(math.maximum(1 - (past / math.maximum(1 - b, 1 - LAMINAR)) ** 2, 0))
        psi = turbulent * math.minimum((1 - ratio) / (1 - LAMINAR), 1)
        warmth = math.sqrt(self.reference_temperature / self.temperature)
        return math.sign(first - second) * self.conductance * self.density * warmth * upstream * psi


@dataclass(frozen=True)
class HydraulicCylinder(FluidCylinder):
    """Drive a slide by oil through a four-way servo valve.

        p_a' = (beta_a / V_a) (Q_a - A_a w - c (p_a - p_b))
        p_b' = (beta_b / V_b) (A_b w - Q_b + c (p_a - p_b))
        Q = flow command sqrt(dp / drop) over each metering edge,    F = p_a A_a - p_b A_b + stops
        1 / beta_i = 1 / beta + air p_0 / p_i^2,    p_0 = 100 kPa

    The oil holds a little air, which expands where a chamber grows faster than oil can flow in:
    pressures stay above 0.

    Sources: Merritt, Hydraulic Control Systems, ch. 1 (air), 5 and 6; Jelali & Kroll, Hydraulic
    Servo-systems, ch. 4.
    """

    flow: float = number("Q of an edge of the open valve at `drop`", "m^3/s", Amount, 1e-3)
    drop: float = number("pressure drop at which `flow` is given", "Pa", Positive, 3.5e6)
    bulk_modulus: float = number("beta of the oil", "Pa", Positive, 1.4e9)
    leakage: float = number("c, between the chambers", "m^3/(s Pa)", Amount, 0.0)
    air: float = number("share of the oil's volume at p_0", "1", Positive, 1e-5)

    type: ClassVar[str] = "hydraulic_cylinder"
    air_pressure: ClassVar[float] = 1e5  # at which the share of air is given [Pa]

    def equations(self, command, x, w, z):
        opening, p_a, p_b = math.clip(command, -1, 1), z[0], z[1]
        V_a, V_b, w_in = self.volumes(x, w)
        filling, emptying = math.maximum(opening, 0), math.maximum(-opening, 0)
        into_a = filling * self.edge(self.supply - p_a) - emptying * self.edge(p_a - self.exhaust)
        into_b = emptying * self.edge(self.supply - p_b) - filling * self.edge(p_b - self.exhaust)
        leaking = self.leakage * (p_a - p_b)
        rates = (
            self.modulus(p_a) / V_a * (into_a - self.area_a * w_in - leaking),
            self.modulus(p_b) / V_b * (into_b + self.area_b * w_in + leaking),
        )
        return p_a * self.area_a - p_b * self.area_b + self.stops(x, w), rates

    def modulus(self, p: Any) -> Any:
        """Return the bulk modulus [Pa] of oil with a little air at a pressure: beta p^2 /
        (p^2 + air p_0 beta)."""
        return self.bulk_modulus * p**2 / (p**2 + self.air * self.air_pressure * self.bulk_modulus)

    def edge(self, dp: Any) -> Any:
        """Return the flow [m^3/s] of an open metering edge under a pressure drop [Pa], smooth about
        zero."""
        return self.flow * dp / math.sqrt(self.drop * math.sqrt(dp**2 + NEAR_ZERO**2))
