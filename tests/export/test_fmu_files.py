"""What an FMU is made of: binaries of all platforms, the standard's own declarations, its
description, refusals."""

import os
import shutil
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import pytest

import linkwork as lw
from linkwork.export.fmi import binaries
from linkwork.export.fmi.description import exponents

from tests.catalogue import built
from tests.export import fmus
from tests.export.compiled import STRICT, compiler, run

HEADERS = Path(fmpy.__file__).parent / "c-code"


def sources(name: str, version: str) -> dict[str, str]:
    files = lw.export.fmu(built(name), version, platforms=()).files  # pyright: ignore
    return {Path(path).name: files[path].decode() for path in files if path.startswith("sources/")}


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_all_functions_are_those_that_the_standard_declares(version, tmp_path):
    """Compiled with the standard's own headers in place of ours every function has its type, and
    the library has all of them."""
    n = version[0]
    for name, text in sources("pendulum", version).items():
        (tmp_path / name).write_text(text)
    (tmp_path / f"fmi{n}.h").write_text(f'#include "fmi{n}Functions.h"\n')
    flags = [*STRICT, "-Wno-unused-parameter", "-O0", "-shared", "-fPIC", f"-I{HEADERS}"]
    files = [f"fmi{n}.c", "pendulum.c", "pendulum_instance.c"]
    run([*compiler("gcc"), *flags, "-o", "all.so", *files, "-lm"], cwd=tmp_path)
    wanted = set()
    for line in (HEADERS / f"fmi{n}Functions.h").read_text().splitlines():
        if line.lstrip().startswith("FMI") and "_Export" in line:
            wanted.add(line.split()[-1].rstrip(";"))
    assert len(wanted) > 40
    assert wanted <= exported(tmp_path / "all.so")


def exported(library: Path) -> set[str]:
    """Return the names of functions that a library has for others."""
    told = run([shutil.which("nm") or "nm", "-D", "--defined-only", library])
    return {line.split()[-1] for line in told.splitlines() if " T " in line}


HEADS = {
    "x86_64-linux": ("binaries/linux64/pendulum.so", b"\x7fELF\x02", b"\x3e"),
    "aarch64-linux": ("binaries/aarch64-linux/pendulum.so", b"\x7fELF\x02", b"\xb7"),
    "x86_64-windows": ("binaries/win64/pendulum.dll", b"MZ", b""),
}
SLOW = pytest.mark.skipif(
    os.environ.get("LINKWORK_HOSTILE") != "all",
    reason="zig's first library for a platform takes up to a minute: set LINKWORK_HOSTILE=all",
)


@pytest.mark.skipif(find_spec("ziglang") is None, reason="zig is not there: pip install ziglang")
@pytest.mark.parametrize(
    "platform", ["x86_64-linux", *(pytest.param(name, marks=SLOW) for name in list(HEADS)[1:])]
)
def test_zig_builds_for_other_platforms(platform):
    export = lw.export.fmu(built("pendulum"), "2.0", platforms=[platform])
    assert export.platforms == (platform,)
    path, magic, machine = HEADS[platform]
    content = fmus.read(export).read(path)
    assert content.startswith(magic) and content[18:19].startswith(machine)
    assert b"fmi2DoStep" in content and b"lw_" not in content


@pytest.mark.long
def test_a_missing_compiler_is_named(monkeypatch):
    monkeypatch.setattr(binaries, "find_spec", lambda name: None)
    with pytest.raises(
        lw.LinkworkError, match=r"no compiler for x86_64-windows: zig .*linkwork\[fmu"
    ):
        lw.export.fmu(built("pendulum"), platforms=["x86_64-windows"])
    export = lw.export.fmu(built("pendulum"))
    own = binaries.this_platform()
    assert export.platforms == ((own,) if shutil.which("cc") and own in binaries.PLATFORMS else ())
    lacking = [note for note in export.notes if note.startswith("there is no compiler for")]
    assert len(lacking) == 3 - len(export.platforms)
    monkeypatch.setattr(binaries.shutil, "which", lambda name: None)
    export = lw.export.fmu(built("pendulum"))
    assert not export.platforms and "importers there can compile the sources" in export.notes[0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"version": "1.0"}, 'version is \'1.0\'; give "3.0" or "2.0"'),
        ({"outputs": ["speed"]}, "no output 'speed' of an FMU"),
        ({"robot": "bricard", "outputs": ["tool"]}, "the output 'tool' needs a tool"),
        ({"platforms": ["amiga"]}, "platform of an FMU"),
        ({"name": "a b"}, "cannot begin names of C"),
    ],
)
def test_choices_that_there_are_not_are_refused(given, said):
    with pytest.raises(lw.LinkworkError) as fault:
        lw.export.fmu(built(given.pop("robot", "pendulum")), **given)
    assert said in str(fault.value)


def test_robots_that_cannot_be_exported_are_refused(tmp_path):
    with pytest.raises(lw.LinkworkError, match=r"the robot is 3; give a linkwork.Robot"):
        lw.export.fmu(3)  # pyright: ignore[reportArgumentType]
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
    friction = lw.Friction(coulomb=0.1, bristle=lw.Bristle(stiffness=100.0))
    hinge = lw.RevoluteJoint(connects=("ground", "body"), friction=friction)
    robot = lw.Robot(lw.Mechanism(name="arm", bodies={"body": body}, joints={"hinge": hinge}))
    with pytest.raises(lw.LinkworkError, match=r"sticks by bristles.*hinge"):
        lw.export.fmu(robot)
    bearing = lw.JournalBearing(friction=lw.Sliding(coefficient=0.3, rate=1e-3), radius=0.02)
    hinge = lw.RevoluteJoint(connects=("ground", "body"), bearing=bearing)
    robot = lw.Robot(lw.Mechanism(name="arm", bodies={"body": body}, joints={"hinge": hinge}))
    with pytest.raises(
        lw.LinkworkError, match=r"an FMU leaves out the friction of bearings.*hinge"
    ):
        lw.export.fmu(robot)
    export = lw.export.fmu(built("pendulum"), platforms=())
    with pytest.raises(lw.LinkworkError, match=r"an FMU ends in .fmu, not '.zip'"):
        export.write(tmp_path / "a.zip")
    with pytest.raises(lw.LinkworkError, match="cannot be written"):
        export.write(tmp_path / "nowhere" / "a.fmu")


def test_units_are_powers_of_base_units():
    assert exponents("N m s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert exponents("kg m²") == {"kg": 1, "m": 2}
    assert exponents("m/s2") == {"m": 1, "s": -2}
    assert exponents("N, N m") is None
    assert exponents("") is None


def test_the_description_tells_units_and_what_depends_on_what(tmp_path):
    robot = built("prr3").free("platform.mass")
    export = lw.export.fmu(robot, outputs=["positions", "accelerations"], platforms=())
    root = ET.fromstring(export.files["modelDescription.xml"])
    variables = {each.get("name"): each for each in root.find("ModelVariables") or ()}
    assert variables["force.slide_1"].get("unit") == "N"
    assert variables["q.slide_1"].get("declaredType") == "Length"
    assert variables["parameter.platform.mass"].get("unit") == "kg"
    assert variables["parameter.platform.mass"].get("variability") == "tunable"
    assert variables["parameter.platform.mass"].get("min") == "0.0"
    inputs = {variables[f"force.{each}"].get("valueReference") for each in robot.actuators}
    on = {
        each.get("valueReference"): {*(each.get("dependencies") or "").split()}
        for each in root.iter("Output")
    }
    position, acceleration = (
        on[variables[f"{kind}.slide_1"].get("valueReference")] for kind in ("joint", "acceleration")
    )
    assert not position & inputs and inputs <= acceleration
