"""The binaries of an FMU: which compiler builds for which platform, and how.

Zig (the extra `linkwork[fmu]`) compiles for all of them on any machine; without it the machine's
own C compiler builds for the machine itself.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.model.checks import names
from linkwork.patience import announced


@dataclass(frozen=True)
class Platform:
    """Describe a platform.

    fmi2: its folder in FMI 2.0; target: what zig calls it; suffix: of libraries; libraries: that
    they are linked with
    """

    fmi2: str
    target: str
    suffix: str
    libraries: tuple[str, ...] = ("-lm",)


PLATFORMS: Mapping[str, Platform] = {
    "x86_64-linux": Platform("linux64", "x86_64-linux-gnu.2.17", ".so"),
    "aarch64-linux": Platform("aarch64-linux", "aarch64-linux-gnu.2.17", ".so"),
    "x86_64-windows": Platform("win64", "x86_64-windows-gnu", ".dll", ()),
}
"""The platforms by their names in FMI 3.0."""
FLAGS = ("-std=c99", "-O2", "-g0", "-fvisibility=hidden", "-shared", "-s")
MISSING = "zig compiles for it on any machine; get it by  pip install 'linkwork[fmu]'"
PATIENCE = 600.0  # [s]


def this_platform() -> str:
    """Return the name of the machine's own platform."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    return f"{machine}-{platform.system().lower()}"


def compiler(name: str) -> list[str] | None:
    """Return the command that compiles for a platform; None where none is found."""
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[name].target]
    own = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    return [own] if own and name == this_platform() else None


def chosen(platforms: object) -> tuple[dict[str, list[str]], list[str]]:
    """Return the compilers by platform, and sentences on platforms that none is found for; refuse
    those if they are asked for by name."""
    everything = platforms is None
    wanted = list(PLATFORMS) if everything else names(platforms, "platforms")  # pyright: ignore
    checks.known(wanted, tuple(PLATFORMS), "platform of an FMU")
    found, notes = {}, []
    for name in wanted:
        command = compiler(name)
        if command is not None:
            found[name] = command
            continue
        sentence = f"there is no compiler for {name}: {MISSING}"
        if not everything:
            raise LinkworkError(sentence)
        notes.append(f"{sentence}; importers there can compile the sources")
    return found, notes


def binary(
    name: str, command: Sequence[str], sources: Mapping[str, str], compiled: Sequence[str]
) -> bytes:
    """Return the library of sources for a platform; compiled: names of those that are compiled."""
    target = PLATFORMS[name]
    with announced(f"compiling for {name}"), tempfile.TemporaryDirectory() as folder:
        for each, text in sources.items():
            Path(folder, each).write_text(text, encoding="utf-8", newline="\n")
        library = f"library{target.suffix}"
        position = [] if target.suffix == ".dll" else ["-fPIC"]
        flags = [*FLAGS, *position, "-o", library, *compiled, *target.libraries]
        done = subprocess.run(
            [*command, *flags],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        if done.returncode:
            raise LinkworkError(
                f"the FMU does not compile for {name} by {' '.join(command)}: "
                f"{done.stderr.strip() or done.stdout.strip()}"
            )
        return Path(folder, library).read_bytes()
