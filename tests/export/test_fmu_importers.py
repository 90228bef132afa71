"""FMUs by importers that are not FMPy: one in C, here and on emulated ARM, fmusim, and VDMCheck3's
judgement, where these are."""

import csv
import os
import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import linkwork as lw
from linkwork.export import FmuExport

from tests.catalogue import built
from tests.export import fmus
from tests.export.compiled import compiler, run
from tests.export.test_fmu_files import HEADERS

IMPORTER = Path(__file__).with_name("importer.c")
DURATION, STEPS = 0.2, 10
FORCES = {"slide_1": 1.0, "slide_2": -2.0}
FMUSIM = shutil.which("fmusim")
WINE = shutil.which("wine64") or shutil.which("wine")
VDMCHECK = os.environ.get("VDMCHECK3")


def expected() -> np.ndarray:
    robot = built("prr3")
    run = robot.simulate(robot.home, FORCES, duration=DURATION, rtol=1e-11, atol=1e-12)
    return run.final.positions


def arm(*tools: str) -> bool:
    return all(map(shutil.which, tools)) and find_spec("ziglang") is not None


@pytest.mark.long
@pytest.mark.parametrize(
    ("command", "emulator", "platform"),
    [
        ("gcc", [], fmus.OWN),
        pytest.param(
            "aarch64-linux-gnu-gcc",
            ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
            "aarch64-linux",
            marks=pytest.mark.skipif(
                not arm("aarch64-linux-gnu-gcc", "qemu-aarch64"),
                reason="needs zig, aarch64-linux-gnu-gcc and qemu-aarch64",
            ),
        ),
    ],
)
def test_an_importer_in_c_simulates(command, emulator, platform, tmp_path):
    robot = built("prr3")
    if platform == fmus.OWN:
        export = lw.export.fmu(robot, platforms=())  # pyright: ignore[reportArgumentType]
        archive = fmus.built(export, tmp_path)
        library = Path(fmus.extracted(archive)) / f"binaries/{platform}/{export.name}.so"
    else:
        export = lw.export.fmu(robot, platforms=[platform])
        library = tmp_path / f"{export.name}.so"
        library.write_bytes(export.files[f"binaries/{platform}/{export.name}.so"])
    importer = tmp_path / "importer"
    run([shutil.which(command) or command, f"-I{HEADERS}", "-o", importer, IMPORTER, "-ldl"])
    require_expected(run([*emulator, importer, library, *asked(export, robot)]).split())


@pytest.mark.skipif(
    os.environ.get("LINKWORK_HOSTILE") != "all" or not WINE or not arm(),
    reason="takes a minute, and needs zig and Wine: set LINKWORK_HOSTILE=all",
)
def test_the_library_for_windows_simulates(tmp_path):
    robot, platform = built("prr3"), "x86_64-windows"
    export = lw.export.fmu(robot, platforms=[platform])
    library, importer = tmp_path / f"{export.name}.dll", tmp_path / "importer.exe"
    library.write_bytes(export.files[f"binaries/{platform}/{library.name}"])
    zig = [*compiler("zig"), "-target", "x86_64-windows-gnu"]
    run([*zig, f"-I{HEADERS}", "-o", importer, IMPORTER])
    own = {**os.environ, "WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}
    told = run([WINE or "", importer, library.name, *asked(export, robot)], cwd=tmp_path, env=own)
    require_expected(told.split()[-len(robot.coordinates) - 1 :])


def asked(export: FmuExport, robot: lw.Robot) -> list[str]:
    """Return what the importer is told: how to simulate, and what to print at the end."""
    token = export.files["modelDescription.xml"].decode().split('instantiationToken="')[1]
    place = {name: str(k) for k, name in enumerate(export.variables)}
    words = [token.split('"')[0], STEPS, DURATION / STEPS, len(FORCES)]
    for name, force in FORCES.items():
        words += [place[f"force.{name}"], force]
    words += [place[f"joint.{each}"] for each in robot.coordinates] + [place["closure_error"]]
    return [*map(str, words)]


def require_expected(printed: list[str]) -> None:
    """The joints are where the robot's own run leaves them, the loops closed."""
    found = [*map(float, printed)]
    np.testing.assert_allclose(found[:-1], expected(), atol=1e-7)
    assert found[-1] < 1e-12


@pytest.mark.skipif(FMUSIM is None, reason="fmusim (github.com/modelica/fmusim) is not on the path")
@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_fmusim_simulates(version, tmp_path):
    robot = built("prr3")
    export = lw.export.fmu(robot, version, platforms=())  # pyright: ignore[reportArgumentType]
    file = fmus.built(export, tmp_path)
    words = [
        FMUSIM or "",
        "simulate",
        "--stop-time",
        DURATION,
        "--output-file",
        tmp_path / "out.csv",
    ]
    for name, force in FORCES.items():
        words += ["--start-value", f"force.{name}={force}"]
    run([*map(str, words), file])
    with (tmp_path / "out.csv").open() as table:
        *_, last = csv.DictReader(table)
    found = [float(last[f"joint.{each}"]) for each in robot.coordinates]
    np.testing.assert_allclose(found, expected(), atol=1e-4)


@pytest.mark.skipif(
    VDMCHECK is None or shutil.which("java") is None,
    reason="VDMCheck3 needs Java, and VDMCHECK3 to name its jar",
)
def test_vdmcheck_finds_no_fault(tmp_path):
    made = lw.export.fmu(built("prr3"), platforms=())  # pyright: ignore
    file = made.write(tmp_path / "prr3.fmu")
    assert "No errors found" in run(["java", "-jar", VDMCHECK or "", file])
