"""The symbols of printed equations: their names in SymPy, their LaTeX and their meanings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy

from linkwork.export.symbolic.dimensions import Dimensions
from linkwork.mechanism.numbers import located

KINDS = {
    "length": ("l", "length [m]"),
    "mass": ("m", "mass [kg]"),
    "inertia": ("I", "moment of inertia about the mass centre [kg m^2]"),
    "pitch": ("p", "advance of a screw [m/rad]"),
    "gravity": ("g", "acceleration of gravity [m/s^2]"),
} | {
    f"inertia_{name}": (f"I{name}", "element of the inertia about the mass centre [kg m^2]")
    for name in ("xx", "yy", "zz", "xy", "xz", "yz")
}
FIELDS = {
    "mass": "m",
    "length": "l",
    "pitch": "p",
    "centre_of_mass": "c",
    "inertia": "I",
    "rotor_inertia": "J",
    "ratios": "n",
    "powers": "n",
    "offset": "d",
}
"""Letters of free numbers, by the field that they stand in."""


@dataclass
class Letters:
    """Make symbols, and remember how they are written and what they mean."""

    latex: dict[sympy.Symbol, str] = field(default_factory=dict)
    meanings: dict[sympy.Symbol, str] = field(default_factory=dict)

    def symbol(self, name: str, latex: str, meaning: str = "") -> sympy.Symbol:
        """Return a real symbol; a name that is taken is refused by what follows it."""
        found = sympy.Symbol(name, real=True)
        self.latex[found] = latex
        if meaning:
            self.meanings[found] = meaning
        return found

    def numbered(self, letter: str, *places: int, latex: str | None = None) -> sympy.Symbol:
        """Return a symbol with indices, as L_4_1."""
        name = "_".join([letter, *map(str, places)])
        own = letter if latex is None else latex
        return self.symbol(name, f"{own}_{{{','.join(map(str, places))}}}" if places else own)


def dimension_symbols(
    letters: Letters, dimensions: Dimensions, used: Sequence[str]
) -> dict[str, sympy.Symbol]:
    """Return the symbols of the dimensions that are used, by their keys.

    Lengths are numbered from the bodies' to the ground's; masses and inertias by kinds of bodies.
    """
    # The bodies of each kind, and the kinds that have mass, in their order.
    mechanism, found = dimensions.mechanism, {}
    owners: dict[str, list[str]] = {}
    for body, kind in dimensions.kinds.items():
        owners.setdefault(str(kind), []).append(body)
    heavy = [
        kind
        for kind in owners
        if any(k.split(":")[1] == kind for k in used if k.startswith(("mass", "inertia")))
    ]
    # Numbers that all are symbols of.
    counts: dict[str, int] = {}
    free = [key for key in used if key.startswith("free:")]
    named = sorted((key for key in used if key not in free), key=order)
    for key in named:
        kind, owner, _ = key.split(":")
        letter, meaning = KINDS[kind]
        if kind.startswith(("mass", "inertia")):
            place = heavy.index(owner) + 1
        else:
            place = counts[kind] = counts.get(kind, 0) + 1
        of = ", ".join(owners.get(owner, [owner] if owner in mechanism.pairs else []))
        told = f"{meaning} of {of}" if of else meaning
        if kind == "gravity" and not owner:
            found[key] = letters.symbol("g", "g", told)
        else:
            subscript = f"_{{{letter[1:]},{place}}}" if len(letter) > 1 else f"_{{{place}}}"
            found[key] = letters.symbol(f"{letter}_{place}", letter[0] + subscript, told)
    # Free numbers by the letters of their fields; equal names are told apart.
    taken = {symbol.name for symbol in found.values()}
    for key in free:
        path = key.removeprefix("free:")
        name, latex = free_name(located(mechanism, path)[0])
        while name in taken:
            name, latex = f"{name}_", latex + "'"
        taken.add(name)
        found[key] = letters.symbol(name, latex, path)
    return found


def order(key: str) -> tuple[str, int, int]:
    kind, owner, place = key.split(":")
    return kind, int(owner) if owner.isdigit() else 10**6, int(place)


def free_name(where: Sequence[str]) -> tuple[str, str]:
    """Return name and LaTeX of a free number: its letter, and what it is of."""
    if where[0] == "gravity":
        axis = "xyz"[int(where[1])]
        return f"g_{axis}", f"g_{{{axis}}}"
    _, owner, *fields = where
    letter = next((FIELDS[each] for each in fields if each in FIELDS), "")
    last = fields[-1]
    if last in "012":
        letter += "xyz"[int(last)]
    elif letter == "I":
        letter += last
    side = fields[1] if fields[0] == "frames" else ""
    parts = [part for part in (owner, side) if part]
    plain = "".join(each if each.isalnum() else "_" for each in "_".join([letter, *parts]))
    words = r"\,".join(
        "".join(each if each.isalnum() else r"\," for each in part) for part in parts
    )
    base = letter[0] if len(letter) == 1 else f"{letter[0]}^{{{letter[1:]}}}"
    return plain, f"{base}_{{\\mathrm{{{words}}}}}"
