"""The same mechanism in other units: lengths, masses and times multiplied by factors. Dimensional
analysis is the truth.

A quantity of the dimension kg^a m^b s^c is multiplied by M^a L^b T^c, so what is computed of the
scaled mechanism must be what is computed of the original one, multiplied likewise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import SLIDES


class Scale:
    """Multiply by L, M, T; `mechanism` is the scaled one."""

    def __init__(self, mechanism: Mechanism, L: float = 1.0, M: float = 1.0, T: float = 1.0):
        self.L, self.M, self.T, self.original = L, M, T, mechanism
        self.slides = {
            label: (joint.freedoms[0] if len(joint.freedoms) == 1 else label.rpartition(".")[2])
            in SLIDES
            for name, joint in mechanism.joints.items()
            for label in (*joint.coordinates(name), *joint.rates(name))
        }
        self.mechanism = Mechanism(**self._scaled(mechanism))

    def factor(self, label: str) -> float:
        """Return the factor of a joint coordinate."""
        return self.L if self.slides[label] else 1.0

    def coordinates(self) -> np.ndarray:
        """Return the factors of all joint coordinates."""
        return np.array([self.factor(label) for label in self.original.coordinates])

    def rates(self, labels: tuple[str, ...]) -> np.ndarray:
        """Return the factors of rates."""
        return np.array([self.factor(label) for label in labels]) / self.T

    def accelerations(self, labels: tuple[str, ...]) -> np.ndarray:
        return self.rates(labels) / self.T

    @property
    def energy(self) -> float:
        return self.M * self.L**2 / self.T**2

    def forces(self, labels: tuple[str, ...]) -> np.ndarray:
        """Return the factors of forces on rates: N on slides, N m on turns."""
        return np.array([self.energy / self.factor(label) for label in labels])

    def _scaled(self, item: Mechanism) -> dict[str, Any]:
        fields = item.model_dump()
        L, M, T = self.L, self.M, self.T
        fields["gravity"] = tuple(x * L / T**2 for x in item.gravity)
        for body in fields["bodies"].values():
            body["mass"] *= M
            body["centre_of_mass"] = times(body["centre_of_mass"], L)
            body["inertia"] = {
                key: x * M * L**2 if isinstance(x, float) else x
                for key, x in body["inertia"].items()
            }
            body["shapes"] = ()
        for name, joint in fields["joints"].items():
            self._scale_joint(item, name, joint)
        for spring in fields["springs"].values():
            spring["points"] = tuple(times(point, L) for point in spring["points"])
            spring["stiffness"] *= M / T**2
            spring["damping"] *= M / T
            spring["rest_length"] *= L
        for tool in fields["tools"].values():
            tool["frame"]["position"] = times(tool["frame"]["position"], L)
        fields["reference"] = {label: x * self.factor(label) for label, x in item.reference.items()}
        return fields

    def _scale_joint(self, item: Mechanism, name: str, joint: dict[str, Any]) -> None:
        L = self.L
        if joint["type"] == "gear":
            units = {label: self.factor(label) for label in joint["ratios"]}
            joint["ratios"] = {
                label: ratio / units[label] for label, ratio in joint["ratios"].items()
            }
            joint["powers"] = {
                label: [c / units[label] ** power for power, c in enumerate(own, start=2)]
                for label, own in joint.get("powers", {}).items()
            }
            return
        for frame in joint["frames"]:
            frame["position"] = times(frame["position"], L)
        for key in ("pitch", "length"):
            if key in joint:
                joint[key] *= L
        own = item.joints[name].freedoms
        for key in ("friction", "spring", "limits", "rotor_inertia"):
            if key not in joint:
                continue
            if len(own) == 1 and own != ("turn",):
                joint[key] = self._effect(key, joint[key], own[0] in SLIDES)
            else:
                joint[key] = {
                    f: self._effect(key, part, f in SLIDES) for f, part in joint[key].items()
                }

    def _effect(self, key: str, part: Any, slide: bool) -> Any:
        """Scale friction, spring, limits or rotor of a freedom: per force unit F and coordinate
        unit x."""
        x, T = (self.L if slide else 1.0), self.T
        F = self.energy / x
        factors = {
            "viscous": F / (x / T), "coulomb": F, "coulomb_rate": x / T, "stiffness": F / x,
            "static": F, "stribeck_rate": x / T,
            "rest": x, "damping": F / (x / T), "lower": x, "upper": x,
        }  # fmt: skip
        if key == "rotor_inertia":
            return part * F / (x / T**2)
        linear, unit = ("viscous", x / T) if key == "friction" else ("stiffness", x)
        powers = [factors[linear] * c / unit**n for n, c in enumerate(part.pop("powers", ()), 1)]
        scaled = {
            field: value if value is None else value * factors[field]
            for field, value in part.items()
        }
        return scaled | ({"powers": powers} if powers else {})


def times(vector: Any, factor: float) -> tuple[float, ...]:
    return tuple(x * factor for x in vector)
