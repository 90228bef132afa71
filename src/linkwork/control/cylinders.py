"""Fluid power: pneumatic and hydraulic cylinders as drives; the command opens the valve, from -1 to 1.

Chamber A pushes towards larger joint coordinates, chamber B the other way. With the piston's travel s = x - retracted:

    V_a = dead_volume + A_a s,    V_b = dead_volume + A_b (stroke - s)

A positive command leads the supply to A and B to the exhaust (or tank), a negative one the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from linkwork import math
from linkwork.control.drives import Drive, Extra

LAMINAR = 0.999  # pressure ratio from which a small pneumatic flow is taken as proportional to the pressure drop
NEAR_ZERO = 1e3  # pressure drop below which an orifice's flow is taken as proportional to it [Pa]


@dataclass(frozen=True)
class Cylinder(Drive):
    """Hold the geometry of a double-acting cylinder, and its supply and exhaust pressures.

    area_a, area_b: effective areas of the piston [m^2]; stroke: [m]; dead_volume: of each chamber and its line [m^3]
    supply, exhaust: absolute pressures at the valve [Pa]; retracted: joint coordinate at the retracted end [m]
    initial_a, initial_b: chamber pressures at the start [Pa]
    """

    area_a: float
    area_b: float
    stroke: float
    supply: float
    exhaust: float
    initial_a: float
    initial_b: float
    dead_volume: float
    retracted: float = 0.0

    unit: ClassVar[str] = "1"
    positive: ClassVar[tuple[str, ...]] = (
        *("area_a", "area_b", "stroke", "supply", "dead_volume"),
        *("initial_a", "initial_b"),
    )

    @property
    def extras(self):
        return Extra("pressure_a", "Pa", self.initial_a), Extra("pressure_b", "Pa", self.initial_b)

    def volumes(self, x: Any) -> tuple[Any, Any]:
        """Return V_a and V_b [m^3] at a joint coordinate."""
        travel = x - self.retracted
        return self.dead_volume + self.area_a * travel, self.dead_volume + self.area_b * (self.stroke - travel)


@dataclass(frozen=True)
class PneumaticCylinder(Cylinder):
    """Drive a slide by air through a proportional 5/3 valve.

        p_i' = (n / V_i) (R T m_i' - p_i V_i'),    F = p_a A_a - p_b A_b - atmosphere (A_a - A_b)

    with the mass flows of a valve opened by |command|, from the pressure p_1 to p_2 (ISO 6358):

        m' = |command| C rho_0 p_1 psi(p_2 / p_1),    psi(r) = 1 for r <= b, sqrt(1 - ((r - b) / (1 - b))^2) above.

    conductance: C of the open valve [m^3/(s Pa)]; critical_ratio: b; exponent: n, from 1 (isothermal) to 1.4 (adiabatic)
    temperature: T of the air [K]; atmosphere: pressure on the rod's end [Pa]
    Sources: ISO 6358-1; Beater, Pneumatic Drives, ch. 4 and 5.
    """

    conductance: float = 2e-8
    critical_ratio: float = 0.3
    exponent: float = 1.2
    temperature: float = 293.15
    atmosphere: float = 101325.0

    gas_constant: ClassVar[float] = 287.058  # of dry air [J/(kg K)]
    density: ClassVar[float] = (
        1.185  # of the reference atmosphere of ISO 8778, 100 kPa and 20 C at 65 % humidity [kg/m^3]
    )

    def equations(self, command, x, w, z):
        opening, (p_a, p_b), (V_a, V_b) = math.clip(command, -1, 1), (z[0], z[1]), self.volumes(x)
        filling, emptying = math.maximum(opening, 0), math.maximum(-opening, 0)
        m_a = filling * self.flow(self.supply, p_a) - emptying * self.flow(p_a, self.exhaust)
        m_b = emptying * self.flow(self.supply, p_b) - filling * self.flow(p_b, self.exhaust)
        heat = self.gas_constant * self.temperature
        force = p_a * self.area_a - p_b * self.area_b - self.atmosphere * (self.area_a - self.area_b)
        rates = (
            self.exponent / V_a * (heat * m_a - p_a * self.area_a * w),
            self.exponent / V_b * (heat * m_b + p_b * self.area_b * w),
        )
        return force, rates

    def flow(self, first: Any, second: Any) -> Any:
        """Return the mass flow [kg/s] of the open valve from one pressure to another; backwards it is negative."""
        upstream, downstream = math.maximum(first, second), math.minimum(first, second)
        ratio, b = downstream / upstream, self.critical_ratio
        turbulent = math.sqrt(math.maximum(1 - (math.maximum(math.minimum(ratio, LAMINAR) - b, 0) / (1 - b)) ** 2, 0))
        psi = turbulent * math.minimum((1 - ratio) / (1 - LAMINAR), 1)
        return math.sign(first - second) * self.conductance * self.density * upstream * psi


@dataclass(frozen=True)
class HydraulicCylinder(Cylinder):
    """Drive a slide by oil through a four-way servo valve.

        p_a' = (beta / V_a) (Q_a - A_a w - c (p_a - p_b)),    p_b' = (beta / V_b) (A_b w - Q_b + c (p_a - p_b))
        Q = flow command sqrt(dp / drop) over each metering edge,    F = p_a A_a - p_b A_b

    flow: Q of an edge of the open valve [m^3/s] at the pressure drop `drop` [Pa]; bulk_modulus: beta of the oil [Pa]
    leakage: c, between the chambers [m^3/(s Pa)]
    Sources: Merritt, Hydraulic Control Systems, ch. 5 and 6; Jelali & Kroll, Hydraulic Servo-systems, ch. 4.
    """

    flow: float = 1e-3
    drop: float = 3.5e6
    bulk_modulus: float = 1.4e9
    leakage: float = 0.0

    def equations(self, command, x, w, z):
        opening, (p_a, p_b), (V_a, V_b) = math.clip(command, -1, 1), (z[0], z[1]), self.volumes(x)
        filling, emptying = math.maximum(opening, 0), math.maximum(-opening, 0)
        into_a = filling * self.edge(self.supply - p_a) - emptying * self.edge(p_a - self.exhaust)
        into_b = emptying * self.edge(self.supply - p_b) - filling * self.edge(p_b - self.exhaust)
        leaking = self.leakage * (p_a - p_b)
        rates = (
            self.bulk_modulus / V_a * (into_a - self.area_a * w - leaking),
            self.bulk_modulus / V_b * (into_b + self.area_b * w + leaking),
        )
        return p_a * self.area_a - p_b * self.area_b, rates

    def edge(self, dp: Any) -> Any:
        """Return the flow [m^3/s] of an open metering edge under a pressure drop [Pa], smooth about zero."""
        return self.flow * dp / math.sqrt(self.drop * math.sqrt(dp**2 + NEAR_ZERO**2))
