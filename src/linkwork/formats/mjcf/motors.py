"""Actuators of MJCF with a block of inputs, as far as one command is enough of it: <pid> and
<dcmotor>.

    pid        f = kp (u_pos - l) + kv (u_vel - l') + u_ff                       absent inputs zero
    dcmotor    f = K i,  i = (v - K l')/R,  or  L i' = v - R i - K l'           v: terminal voltage
               v = u_voltage,  or  (R/K) tau + K l'  of the torque tau that a controller as in pid
               commands, so that f = tau where there is no inductance

The command is the first input that there is; the others stay zero, which is noted.

Source: the MJCF reference of MuJoCo 4, "actuator/pid" and "actuator/dcmotor", and its technical
note on DC motors (doc/dcmotor).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linkwork.formats.mjcf.presets import motor_constants
from linkwork.formats.xml import Element

KEPT = ("ki", "slewmax")  # of pid, what adds states
STATES = ("thermal", "lugre", "cogging")  # of dcmotor, what no drive here has
CONTROLLER = ("kp", "ki", "kd", "slewmax", "Imax", "Vmax")


@dataclass(frozen=True)
class MotorLaw:
    """Hold what a drive is made of.

    gain, bias: constant, by l and by l', of f = gain c + bias
    largest: of |f|, 0 for none
    inductance, resistance, constant: L, R and K; the current is a state where L is not zero
    ranged: what the attribute of the command's range begins with
    unused: inputs that stay zero
    """

    gain: np.ndarray
    bias: np.ndarray
    largest: float = 0.0
    inductance: float = 0.0
    resistance: float = 0.0
    constant: float = 0.0
    ranged: str = "ctrl"
    unused: tuple[str, ...] = ()


def motor_law(element: Element, damping: float) -> MotorLaw | str:
    """Return the law of a <pid> of that kv, or of a <dcmotor>, or the attribute by which it is none
    here."""
    if element.tag == "dcmotor":
        return _of_motor(element)
    more = [key for key in KEPT if element.number(key, 0.0)]
    if more:
        return more[0]
    tokens = element.attributes.get("input", "pos vel").split()
    return _commanded(element, tokens, element.number("kp", 1.0), damping)


def _of_motor(element: Element) -> MotorLaw | str:
    # What has states of its own, or bends the law.
    more = [key for key in STATES if any(_several(element, key, 6))]
    if more:
        return more[0]
    kp, ki, kd, slew, _, highest = _several(element, "controller", len(CONTROLLER))
    if ki or slew or highest:
        return "controller"
    K, R = _constants(element)
    torque, current, change = (max(most, 0.0) for most in _several(element, "saturation", 3))
    L, lag = _several(element, "inductance", 2)
    L = L or lag * R
    if L < 0:
        raise element.refusal("has an inductance below 0; give what is not negative")
    largest = torque or K * current
    tokens = element.attributes.get("input", "voltage").split()
    # A controller's torque is what arrives where the current follows at once.
    if tokens != ["voltage"] and tokens != ["none"]:
        law = "inductance" if L else _commanded(element, tokens, kp, kd)
        return law if isinstance(law, str) else replace(law, largest=largest)
    if L and (change or tokens == ["none"]):
        return "saturation" if change else "inductance"
    steady = K / R
    gain = np.array([steady if tokens == ["voltage"] else 0.0, 0, 0])
    return MotorLaw(gain, np.array([0, 0, -K * steady]), largest, L, R, K)


def _commanded(element: Element, tokens: list[str], kp: float, kv: float) -> MotorLaw | str:
    """Return the law of a controller whose command is the first of its inputs."""
    gains = {"pos": kp, "vel": kv, "ff": 1.0}
    if not tokens or set(tokens) - {*gains}:
        return "input"
    first, *unused = tokens
    ranged = first if f"{first}range" in element.attributes else "ctrl"
    gain, bias = np.array([gains[first], 0, 0]), np.array([0, -kp, -kv])
    return MotorLaw(gain, bias, ranged=ranged, unused=tuple(unused))


def _constants(element: Element) -> tuple[float, float]:
    """Return K and R of a motor."""
    given = [*_several(element, "motorconst", 2), *_several(element, "nominal", 3)]
    K, R = motor_constants(element)
    if K <= 0 or min(given[:2]) < 0:
        raise element.refusal("has no motor constant above 0; give motorconst, or all of nominal")
    if R <= 0:
        raise element.refusal("has no resistance above 0; give resistance, or all of nominal")
    return K, R


def _several(element: Element, name: str, count: int) -> list[float]:
    """Return the first few numbers of an attribute, zeros where there are fewer."""
    given = element.numbers(name, tuple(range(1, count + 1)), (0.0,))
    return [*given, *[0.0] * (count - len(given))]
