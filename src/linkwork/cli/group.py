"""How commands are found and refuse: words of other tools lead to ours, and a refusal is one
sentence."""

import inspect
import sys
import traceback
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from linkwork.cli import usage
from linkwork.cli.caveats import STRICT, told
from linkwork.errors import LinkworkError

REFUSED = 2
DEBUG = "--debug"
MEANT = {
    **dict.fromkeys(("list", "ls", "catalogue", "catalog"), "robots"),
    **dict.fromkeys(("run", "sim"), "simulate"),
    **dict.fromkeys(("analyze", "analysis", "study"), "analyse"),
    **dict.fromkeys(("show", "open", "viewer"), "view"),
    **dict.fromkeys(("import", "load"), "convert"),
    **dict.fromkeys(("path", "trajectory"), "follow"),
    **dict.fromkeys(("inverse", "inverse-dynamics", "forward", "terms"), "dynamics"),
}


class Subcommands(TyperGroup):
    """Hold commands; one that is not there is refused with the nearest."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        known = self.get_command(ctx, args[0]) is not None
        if not (known or ctx.resilient_parsing or args[0].startswith("-")):
            raise LinkworkError(usage.no_command(args[0], ctx))
        return super().resolve_command(ctx, args)


class CommandGroup(Subcommands):
    """Turn refusals into one sentence, and let `--debug` and `--strict` stand anywhere."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        anywhere = [flag for flag in (DEBUG, STRICT) if flag in args]
        words = [*anywhere, *(arg for arg in args if arg not in anywhere)]
        try:
            return super().parse_args(ctx, words)
        except BrokenPipeError:
            raise
        except (usage.UsageError, OSError) as error:
            refuse(error)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] in MEANT:
            raise LinkworkError(f"there is no command {args[0]!r}; use 'linkwork {MEANT[args[0]]}'")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with told(ctx.params["strict"]):
                return super().invoke(ctx)
        except BrokenPipeError:
            raise
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
            if not isinstance(error, LinkworkError | OSError | usage.UsageError):
                raise
            refuse(error, ctx.params["debug"])


def interrupted(error: BaseException | None) -> bool:
    """Whether an interruption is what made an error, as in a library that was being loaded."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def refuse(error: Exception, debug: bool = False) -> NoReturn:
    """Print a refusal as one sentence, or where it was raised, and leave."""
    if usage.asks_for_help(error):
        raise error
    if debug:
        traceback.print_exception(error)
    else:
        print(f"linkwork: {sentence(error)}", file=sys.stderr)
    raise typer.Exit(REFUSED) from None


def sentence(error: Exception) -> str:
    """Return a refusal as one line."""
    if isinstance(error, usage.UsageError):
        return " ".join(usage.sentence(error).split())
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return f"{place}{error.strerror.lower()}"
    return " ".join(str(error).split())


def reflow(*apps: typer.Typer) -> None:
    """Let the help of commands be broken where the terminal ends, not where docstrings are."""
    for app in apps:
        for command in app.registered_commands:
            text = inspect.getdoc(command.callback) or ""
            command.help = "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))
