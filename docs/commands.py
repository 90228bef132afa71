"""The page of the command line, written from the commands themselves."""

from collections.abc import Iterator
from enum import Enum
from typing import Any

import typer

from linkwork.cli import app

HEAD = """# Command line

`linkwork COMMAND --help` tells the same. A command that cannot do what it is asked says so in one
sentence and exits with 2; a run that ends early exits with 1 and keeps what it has. ROBOT is a
robot of the [catalogue](catalogue.md) or a [mechanism file](mechanism-file.md).

With `--json` a command prints plain data instead of tables. `linkwork --install-completion` lets
the shell complete commands, options, robots and files.
"""


def page() -> str:
    """Return the page."""
    return "\n".join([HEAD, *entries(typer.main.get_command(app), "linkwork")])


def entries(group: Any, name: str) -> Iterator[str]:
    """Yield the entries of a group's commands."""
    for word, command in group.commands.items():
        if hasattr(command, "commands"):
            yield entry(command, f"{name} {word}", *arguments(command), "COMMAND")
            yield from entries(command, " ".join([name, word, *arguments(command)]))
        else:
            yield entry(command, f"{name} {word}", *arguments(command))


def arguments(command: Any) -> list[str]:
    found = [p for p in command.params if p.param_type_name == "argument"]
    return [spelled(p) if p.required else f"[{spelled(p)}]" for p in found]


def entry(command: Any, name: str, *words: str) -> str:
    """Return the entry of a command: what it does, its arguments and options."""
    rows = [f"| `{spelled(p)}` | {told(p)} |" for p in command.params if "--help" not in p.opts]
    table = "\n".join(["| | |", "| --- | --- |", *rows]) if rows else ""
    usage = " ".join([name, *words])
    return f"## {name}\n\n    {usage}\n\n{command.help or ''}\n\n{table}\n"


def spelled(parameter: Any) -> str:
    """Return an argument or option as it is written."""
    metavar = parameter.metavar or parameter.name.upper()
    if parameter.param_type_name == "argument":
        return metavar
    return ", ".join([*parameter.opts, *parameter.secondary_opts]) + (
        "" if getattr(parameter, "is_flag", False) else f" {metavar}"
    )


def told(parameter: Any) -> str:
    """Return the help of a parameter, what it may be, and its default."""
    text = str(parameter.help or "").replace("|", "\\|").replace("<", "&lt;")
    value = parameter.default
    if isinstance(value, Enum) and parameter.metavar is None:
        text += f" One of {', '.join(each.value for each in type(value))}."
    if value is None or isinstance(value, bool) or value == "" or callable(value):
        return text
    return f"{text} Default: {value}."
