"""Parameters of many robots that are stepped on together: read and written between two steps, and
refused where no description, drive or controller may have them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.runs.members import Members, require_numbers


class MemberParameters(Mapping[str, np.ndarray]):
    """Hold parameters by name, (N,) each: of what acts, and of the robot those that vary.

    Each is a view of the memory that steps read. Of the robot's own only those may be written that
    leave the loops closed; the others are read-only.

    batch: the members; p: their parameters (np, N)
    """

    def __init__(self, batch: Members, p: np.ndarray):
        own, acting = batch.robot.parameters, batch.system.acting
        equations = batch.robot.equations
        self._mechanism, self._acting = batch.robot.mechanism, acting
        self._views, self._own = {}, []
        for i, name in enumerate((*own, *(acting.parameters if acting else ()))):
            if name not in own or name in batch.varied:
                closing = name in own and ca.depends_on(equations.rows.phi, equations.p[i])
                self._views[name] = p[i].view()
                self._views[name].flags.writeable = not closing
                self._own += [name] if name in own else []
        self._admitted = {name: p.copy() for name, p in self._views.items() if p.flags.writeable}

    def __getitem__(self, name: str) -> np.ndarray:
        return self._views[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._views)

    def __len__(self) -> int:
        return len(self._views)

    def __repr__(self) -> str:
        return repr(self._views)

    def __setitem__(self, name: str, values: ArrayLike) -> None:
        """Write a parameter of all members, (N,) or one number.

        Raises:
            LinkworkError: a name that is not there, or closes loops; numbers that do not fit, or
                that nothing may have; nothing is written then.
        """
        checks.known([name], [*self._views], "parameter")
        if name not in self._admitted:
            raise LinkworkError(
                f"the loops close otherwise by {name!r}; make other steppers with it: "
                "robot.stepper(states, dt, parameters=...)"
            )
        given, (N,) = checks.finite(values, f"parameter {name!r}"), self._views[name].shape
        if given.shape not in ((), (N,)):
            raise LinkworkError(
                f"parameter {name!r} has the shape {given.shape}; give one number, or {N}, one for "
                "each robot"
            )
        self._require({name: np.broadcast_to(given, N)})
        self._views[name][:] = given
        self._admitted[name][:] = given

    def require(self) -> None:
        """Refuse numbers that were written since they were looked at last, and that nothing may
        have; of those that are not finite steps tell by their status."""
        written = {
            name: np.where(np.isfinite(self._views[name]), self._views[name], before)
            for name, before in self._admitted.items()
            if not np.array_equal(self._views[name], before)
        }
        if written:
            self._require(written)
            self._admitted |= written

    def _require(self, written: Mapping[str, np.ndarray]) -> None:
        """Refuse numbers by name (N,) that the description, a drive or a controller may not
        have."""
        own = {name: written.get(name, self._views[name]) for name in self._own}
        if written.keys() & own.keys():
            require_numbers(self._mechanism, own)
        if self._acting:
            self._acting.require({k: values for k, values in written.items() if k not in own})
