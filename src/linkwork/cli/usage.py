"""What is wrong with the words of a command, in one sentence: a word that there is not, one that
lacks, one too many, a value of another kind."""

import re
from typing import Any

import typer

# What Typer raises, be it of Click or of its own copy of Click.
UsageError: Any = typer.BadParameter.__base__

KINDS = {"valid integer": "a whole number", "valid number": "a number", "valid float": "a number"}
EXTRA = re.compile(r"extra argument\S* \((.*)\)$")


def asks_for_help(error: Exception) -> bool:
    """Whether nothing is wrong: no words were given, and the help is the answer."""
    return type(error).__name__ == "NoArgsIsHelpError"


def sentence(error: Any) -> str:
    """Return what is wrong, and what would be right, from what Typer raised."""
    kind, context, param = type(error).__name__, error.ctx, getattr(error, "param", None)
    message = in_words(error.message)
    if context is None:
        return message
    command = called(context)
    if kind == "NoSuchOption":
        near = nearest_option(error.option_name, context)
        return f"there is no option {error.option_name}{near}; see '{command} --help'"
    if kind == "MissingParameter" and param is not None:
        return f"'{command}' needs {described(param)}"
    if kind == "BadParameter" and param is not None:
        rights = [right for theirs, right in KINDS.items() if theirs in message]
        return f"{name(param)} takes {rights[0]}" if rights else f"{name(param)}: {message}"
    if kind == "UsageError" and hasattr(context.command, "commands"):
        return f"'{command}' needs a command: {', '.join(visible(context))}"
    if further := EXTRA.search(message):
        return f"'{command}' takes no further word such as {further[1]!r}; see '{command} --help'"
    return f"{message}; see '{command} --help'"


def no_command(word: str, context: typer.Context) -> str:
    """Return that a group has no such command: the nearest one, or all of them."""
    from linkwork.checks import suggestion

    commands = visible(context)
    arguments = [name(param) for param in context.command.params if is_argument(param)]
    if near := suggestion(word, commands):
        return f"there is no command {word!r}{near}"
    pattern = " ".join([called(context), *arguments, "COMMAND"])
    turned = [given for given in context.params.values() if given in commands]
    meant = "".join(f" (did you mean '{called(context)} {word} {given}'?)" for given in turned)
    known = ", ".join(commands)
    return (
        f"there is no command {word!r}; write '{pattern}' with one of the commands {known}{meant}"
    )


def called(context: typer.Context) -> str:
    """Return what users type for a command, "linkwork analyse ROBOT modes"."""
    _, *words = re.sub(r"[{}]", "", context.command_path).split()
    return " ".join(["linkwork", *words])


def visible(context: typer.Context) -> list[str]:
    """Return the names of a group's commands."""
    group: Any = context.command
    return [name for name, command in group.commands.items() if not command.hidden]


def nearest_option(word: str, context: typer.Context) -> str:
    """Ask whether the nearest of the command's options is meant, if one is near."""
    from linkwork.checks import suggestion

    options = [
        option
        for param in context.command.params
        for option in (*param.opts, *param.secondary_opts)
    ]
    long = [option[2:] for option in (*options, "--help") if option.startswith("--")]
    begun = [name for name in long if word[2:] and name.startswith(word[2:])]
    return suggestion(begun[0] if begun else word.lstrip("-"), long).replace("mean ", "mean --")


def described(param: Any) -> str:
    """Return an argument or option with what its help says of it."""
    text = (getattr(param, "help", None) or "").strip().rstrip(".")
    return f"{name(param)}: {text[0].lower()}{text[1:]}" if text else name(param)


def name(param: Any) -> str:
    """Return how users know an argument or option."""
    return (param.metavar or param.name.upper()) if is_argument(param) else param.opts[0]


def is_argument(param: Any) -> bool:
    """Whether it is an argument, not an option."""
    return param.param_type_name == "argument"


def in_words(message: str) -> str:
    """Return Typer's own words as part of a sentence."""
    message = message.removeprefix("Value error, ")
    return message[:1].lower() + message[1:].rstrip(".")
