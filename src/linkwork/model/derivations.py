"""Derivations: what was derived of a mechanism is kept beside its kernels, so that one process
derives it for all.

An entry is named by all that it follows from: the description, what was asked of it, the source of
this library, the versions of what it derives with, and the machine. It holds objects of the stages
that describe and derive, written by `pickle`; their expressions are written by CasADi, all in one
piece, for they share symbols. Nothing is read but the classes of these stages, arrays and functions
of CasADi; and like machine code, entries are only as safe as the folder, which is the user's own
(`kernels.cache`).
"""

from __future__ import annotations

import hashlib
import io
import pickle
import struct
import sys
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from linkwork.equations import Equations, derive
from linkwork.equations.orientation import GROUND_AXES
from linkwork.equations.tree import GROUND_NODE
from linkwork.kernels import cache
from linkwork.kernels.machine import this_machine
from linkwork.mechanism import Mechanism
from linkwork.patience import announced

Found = TypeVar("Found")

GROUND = [GROUND_AXES, GROUND_NODE]  # of which there is one in a process, of all trees
STAGES = "linkwork.mechanism.", "linkwork.equations."
OTHERS = {
    "builtins": {"range"},
    "casadi": {"Function"},
    "linkwork": {"FixedEntries"},
    "numpy": {"dtype", "ndarray", "_frombuffer", "_reconstruct", "scalar"},
}
PROTOCOL, LEVEL = 5, 1  # of pickle, and of compression
LENGTH = struct.Struct("<q")


def kept(find: Callable[[], Found], *parts: str) -> Found:
    """Return what is found of parts that determine it, from the folder of the kernels if it was
    found before and can be read."""
    versions = sys.version, ca.CasadiMeta.version(), np.__version__, this_machine().identity
    name = cache.key("derivation", cache.source("linkwork").hex(), *versions, *parts)
    content = cache.read(name)
    if content is not None:
        with suppress(pickle.UnpicklingError):
            return unpacked(content)
    found = find()
    cache.write(name, packed(found))
    return found


def derived(mechanism: Mechanism, independent: tuple[str, ...], free: tuple[str, ...]) -> Equations:
    """Return the equations of a mechanism (`derive`), by whose key what follows from them can be
    kept, too."""
    parts = repr(mechanism.model_dump()), repr(independent), repr(free)
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def find() -> Equations:
        with announced(f"deriving the equations of motion of {mechanism.name}"):
            return replace(derive(mechanism, independent, free), key=key)

    return kept(find, "equations", key)


def packed(value: object) -> bytes:
    """Return an object and its expressions as bytes."""
    file = io.BytesIO()
    pickler = DerivationPickler(file)
    pickler.dump(value)
    serializer = ca.StringSerializer()
    serializer.pack(pickler.expressions)
    text = zlib.compress(serializer.encode().encode(), LEVEL)
    return LENGTH.pack(len(text)) + text + zlib.compress(file.getvalue(), LEVEL)


def unpacked(content: bytes) -> Any:
    """Return what was packed."""
    (length,) = LENGTH.unpack_from(content)
    text, objects = content[LENGTH.size :][:length], content[LENGTH.size + length :]
    expressions = ca.StringDeserializer(zlib.decompress(text).decode()).unpack()
    return DerivationUnpickler(io.BytesIO(zlib.decompress(objects)), expressions).load()


class DerivationPickler(pickle.Pickler):
    """Write objects, and the number of each expression in their place."""

    def __init__(self, file: io.BytesIO):
        super().__init__(file, PROTOCOL)
        self.expressions: list[ca.SX] = []
        self._numbers: dict[int, int] = {}

    def persistent_id(self, obj: object) -> int | None:
        if obj is GROUND_AXES or obj is GROUND_NODE:
            return GROUND.index(obj) - len(GROUND)
        if type(obj) is not ca.SX:
            return None
        number = self._numbers.setdefault(id(obj), len(self.expressions))
        if number == len(self.expressions):
            self.expressions.append(obj)
        return number


class DerivationUnpickler(pickle.Unpickler):
    """Read objects with their expressions; refuse any but those that are written here."""

    def __init__(self, file: io.BytesIO, expressions: list[ca.SX]):
        super().__init__(file)
        self._expressions = expressions

    def persistent_load(self, pid: int) -> ca.SX:
        return self._expressions[pid] if pid >= 0 else GROUND[pid]

    def find_class(self, module_name: str, global_name: str) -> Any:
        own = module_name.startswith(STAGES)
        if own or global_name in OTHERS.get(module_name.partition(".")[0], ()):
            found = super().find_class(module_name, global_name)
            if isinstance(found, type) or not own:
                return found
        raise pickle.UnpicklingError(f"{module_name}.{global_name} is no part of a derivation")
