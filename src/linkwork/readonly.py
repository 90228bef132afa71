"""Read-only: arrays, numbers and attributes that nobody may write into once they are made, for what
was found from them would stay as it was."""

from typing import Any, ClassVar, TypeVar

import numpy as np

from linkwork.errors import LinkworkError

Value = TypeVar("Value")


class ReadOnlyArrays:
    """Let nobody write into the arrays that an object holds; NumPy refuses it."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if type(value) is np.ndarray and value.flags.writeable:
                value.setflags(write=False)

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        ReadOnlyArrays.__post_init__(self)


class FixedMapping(dict[str, Value]):
    """Refuse to be changed in place, in the words of its kind."""

    refusal: ClassVar[str]

    def _refuse(*given: Any, **_: Any) -> Any:
        raise LinkworkError(given[0].refusal)

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse


class FreeNumbers(FixedMapping[float]):
    """Hold the values of a robot's free numbers, by path; they are not changed in place."""

    refusal = (
        "the parameters of a robot are not changed in place; "
        "robot.with_parameters({path: value}) returns the robot with other values"
    )

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


class FixedEntries(FixedMapping[Any]):
    """Hold the parts of a description by name; they are not changed in place."""

    refusal = (
        "the parts of a description are not changed in place; make another description, such as "
        "Mechanism(bodies={**mechanism.bodies, 'rod': rod}, joints=mechanism.joints)"
    )

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
