"""The options that a model takes over from one that is attached to it, by <compiler conflict>.

warning  none: its own hold
merge    those that it does not give itself, and all that the other model switches off; two values
         of one option are refused
error    none; two values are refused

Source: MuJoCo's documentation, "Model Editing", "Attribute Merging".
"""

from __future__ import annotations

from dataclasses import replace

from linkwork.formats.xml import Element

SET_BY_OPTIONS = ("gravity", "density", "viscosity", "wind")
WARNING, MERGE, ERROR = MODES = ("warning", "merge", "error")

Settings = dict[str, str | tuple[float, ...]]


def mode_of(root: Element) -> str:
    """Return what a document does where its options and those of another model are not the same."""
    mode = WARNING
    for section in root.each("compiler"):
        mode = section.choice("conflict", MODES, mode)
    return mode


def taken_over(root: Element, model: Element) -> list[Element]:
    """Return the options that a document, with what it has taken over, takes over from a model that
    is attached to it."""
    # Two values of one option hold nowhere.
    mode = mode_of(root)
    if mode == WARNING:
        return []
    told = _told(root, mode)
    for option in model.each("option"):
        for name, value in _said(option, mode).items():
            if told.get(name, value) != value:
                raise option.refusal(
                    f"{name} is another one than that of the model that it is attached to, where "
                    f"conflict={mode!r}; give both the same, or one of them none"
                )
    # What the document does not tell itself, and what the model switches off.
    if mode == ERROR:
        return []
    return [_without(option, told) for option in model.each("option")]


def _told(root: Element, mode: str) -> Settings:
    told: Settings = {}
    for option in root.each("option"):
        told |= _said(option, mode)
    return told


def _said(option: Element, mode: str) -> Settings:
    given = [name for name in SET_BY_OPTIONS if name in option.attributes]
    switches = [flag.attributes for flag in option.each("flag")] if mode == ERROR else []
    return {name: option.numbers(name, (1, 3)) for name in given} | {
        f"flag {name}": value for each in switches for name, value in each.items()
    }


def _without(option: Element, told: Settings) -> Element:
    """Return what an option gives beside what is told, and what it switches off."""
    attributes = {
        name: value
        for name, value in option.attributes.items()
        if (name in SET_BY_OPTIONS and name not in told) or name == "actuatorgroupdisable"
    }
    flags = [
        replace(
            flag,
            attributes={k: value for k, value in flag.attributes.items() if value == "disable"},
        )
        for flag in option.each("flag")
    ]
    return replace(option, attributes=attributes, children=flags)
