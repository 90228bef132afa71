"""What the commands print: tables that fit 80 columns, and a sign of life where something takes
long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Timer

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

PATIENCE = 1.0  # how long nothing is shown [s]


def console() -> Console:
    """Return a console that prints text as it is: names are no markup."""
    return Console(markup=False, highlight=False)


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()
) -> Table:
    """Return a table; the columns in `numbers` are set flush right."""
    made = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
    for index, title in enumerate(header):
        made.add_column(
            Text(title), justify="right" if index in numbers else "left", overflow="fold"
        )
    for row in rows:
        made.add_row(*map(Text, row))
    return made


def facts(rows: Sequence[tuple[str, str]]) -> Table:
    """Return a list of names and values."""
    made = Table.grid(padding=(0, 2, 0, 0))
    for name, value in rows:
        made.add_row(Text(name, style="bold"), Text(value))
    return made


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Show what is going on, on the terminal's stderr, once it has taken longer than a second."""
    status = Console(stderr=True).status(f"{what} ...")
    timer = Timer(PATIENCE, status.start)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        status.stop()
