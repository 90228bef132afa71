"""Read-only: arrays, numbers and attributes that nobody may write into once they are made, for what
was found from them would stay as it was."""

from typing import Any

import numpy as np

from linkwork.errors import LinkworkError


class ReadOnlyArrays:
    """Let nobody write into the arrays that an object holds; NumPy refuses it."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if type(value) is np.ndarray and value.flags.writeable:
                value.setflags(write=False)

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        ReadOnlyArrays.__post_init__(self)


def refuse_change(*_: Any, **__: Any) -> Any:
    """Refuse to change numbers in place."""
    raise LinkworkError(
        "the parameters of a robot are not changed in place; "
        "robot.with_parameters({path: value}) returns the robot with other values"
    )


class FreeNumbers(dict[str, float]):
    """Hold the values of a robot's free numbers, by path; they are not changed in place."""

    __setitem__ = __delitem__ = __ior__ = refuse_change
    clear = pop = popitem = setdefault = update = refuse_change

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


def refuse_entries(*_: Any, **__: Any) -> Any:
    """Refuse to change a description in place."""
    raise LinkworkError(
        "the parts of a description are not changed in place; make another description, such as "
        "Mechanism(bodies={**mechanism.bodies, 'rod': rod}, joints=mechanism.joints)"
    )


class FixedEntries(dict[str, Any]):
    """Hold the parts of a description by name; they are not changed in place."""

    __setitem__ = __delitem__ = __ior__ = refuse_entries
    clear = pop = popitem = setdefault = update = refuse_entries

    def __reduce__(self) -> tuple[Any, ...]:
        return FixedEntries, (dict(self),)


def fix_entries(fields: dict[str, Any]) -> None:
    """Let the mappings among a description's fields be changed no more."""
    found = {name: FixedEntries(each) for name, each in fields.items() if type(each) is dict}
    fields.update(found)


class SetOnce:
    """Let attributes that are for users be set once, where the object is made."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in vars(self) or hasattr(type(self), name):
            raise LinkworkError(
                f"{name} of {self!r} is not set; make another robot, or one with other values of "
                "its free numbers by robot.with_parameters({path: value})"
            )
        super().__setattr__(name, value)
