"""What goes with the C: its self-test, CMake and pkg-config, other processors, floats."""

import os
import re
import shutil

import mpmath
import numpy as np
import pytest

import linkwork as lw

from tests.catalogue import built
from tests.export.compiled import STRICT, Library, compiler, run

SAME = "-DROBOT_3_PRR_SAME_NUMBERS"
PROCESSORS = {
    "aarch64": ("aarch64-linux-gnu-gcc", "qemu-aarch64"),
    "armhf": ("arm-linux-gnueabihf-gcc", "qemu-arm"),
}
TARGETS = {
    "Cortex-M7": ("-target", "thumb-linux-musleabihf", "-mcpu=cortex_m7"),
    "aarch64": ("-target", "aarch64-linux-musl"),
    "riscv64": ("-target", "riscv64-linux-musl"),
    "wasm": ("-target", "wasm32-wasi-musl"),
    "Windows": ("-target", "x86_64-windows-gnu"),
}


def written(folder, **options) -> list:
    """Return the self-test of the 3-PRR as a compiler takes it."""
    export = lw.export.c(built("prr3"), **options)
    export.write(folder)
    return [folder / f"{export.name}_selftest.c", folder / f"{export.name}.c"]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "options", [{}, {"precision": "float"}, {"precision": "float", "sines": "libm"}]
)
def test_the_self_test_passes(options, tmp_path):
    program = tmp_path / "selftest"
    sources = written(tmp_path, **options)
    run([*compiler("gcc"), *STRICT, "-O1", *sources, "-o", program, "-lm"])
    told = run([program])
    assert "WRONG" not in told
    assert {line.split()[0] for line in told.splitlines()} >= {"motion", "tool_to_joints", "step"}


def test_the_self_test_finds_a_wrong_number(tmp_path):
    sources = written(tmp_path, functions=["motion", "kinematics"])
    text = sources[1].read_text()
    place = text.index(" - v", text.index("_motion_code("))
    sources[1].write_text(f"{text[:place]} + v{text[place + 4 :]}")
    program = tmp_path / "selftest"
    run([*compiler("gcc"), *sources, "-o", program, "-lm"])
    with pytest.raises(AssertionError, match="WRONG"):
        run([program])


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_mathematics_without_rules_is_refused(flag, tmp_path):
    sources = written(tmp_path, functions=["motion"])
    with pytest.raises(AssertionError, match=r"compile without -ffast-math"):
        run([*compiler("gcc"), flag, "-c", sources[1], "-o", tmp_path / "one.o"])


@pytest.mark.long
def test_cmake_and_pkg_config_find_it(tmp_path):
    if not (shutil.which("cmake") and shutil.which("pkg-config")):
        pytest.skip("cmake or pkg-config is not installed")
    written(tmp_path, functions=["motion"])
    build, there = tmp_path / "build", tmp_path / "there"
    run(["cmake", "-S", tmp_path, "-B", build])
    run(["cmake", "--build", build])
    run(["ctest", "--test-dir", build, "--output-on-failure"])
    run(["cmake", "--install", build, "--prefix", there])
    search = {**os.environ, "PKG_CONFIG_PATH": str(there / "lib" / "pkgconfig")}
    flags = run(["pkg-config", "--cflags", "--libs", "robot_3_prr"], env=search).split()
    user = tmp_path / "user.c"
    user.write_text(
        '#include "robot_3_prr.h"\n#include <stdio.h>\nint main(void)\n{\n'
        "    double u[3] = {1, 2, 3}, v[3] = {0, 0, 0}, dq[7], dv[3];\n"
        "    int status = (int)robot_3_prr_motion(robot_3_prr_home, v, u, dq, dv);\n"
        '    printf("%d %.17g %.17g %.17g", status, dv[0], dv[1], dv[2]);\n    return 0;\n}\n'
    )
    run([*compiler("gcc"), user, "-o", tmp_path / "user", *flags])
    status, *found = run([tmp_path / "user"]).split()
    robot = built("prr3")
    expected = robot.forward_dynamics(robot.home, [1.0, 2.0, 3.0])
    assert status == "0"
    np.testing.assert_allclose([*map(float, found)], expected, rtol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("processor", PROCESSORS)
def test_other_processors_find_the_same_numbers(processor, tmp_path):
    """The same bits as on this machine, for what the self-test prints are differences."""
    command, machine = PROCESSORS[processor]
    if missing := [each for each in (command, machine) if not shutil.which(each)]:
        pytest.skip(f"{' and '.join(missing)} not installed")
    sources = written(tmp_path, functions=["motion", "inverse_dynamics", "tool_to_joints"])
    told = []
    for number, (compiling, running) in enumerate(
        ((compiler("gcc"), []), ([command, "-static"], [machine]))
    ):
        program = tmp_path / f"selftest{number}"
        run([*compiling, *STRICT, "-O1", SAME, *sources, "-o", program, "-lm"])
        told.append(run([*running, program]))
    assert told[0] == told[1]


@pytest.mark.long
def test_zig_compiles_it_for_other_processors(tmp_path):
    if not compiler("zig"):
        pytest.skip("zig is not installed")
    source = written(tmp_path, functions=["motion"])[1]
    for target in TARGETS.values():
        run([*compiler("zig"), *STRICT, *target, "-Os", "-c", source, "-o", tmp_path / "one.o"])


def test_sines_of_floats(tmp_path):
    """Within two units in the last place up to the bound, beyond it the C library's."""
    text = written(tmp_path, functions=["motion"], precision="float")[1].read_text()
    begin, end = text.index("/* Products"), text.index("#define ROBOT_3_PRR_PIVOT_BOUND")
    user = tmp_path / "sines.c"
    user.write_text(
        '#include "robot_3_prr.h"\n#include <math.h>\n#include <stdint.h>\n'
        + text[begin:end].split("static robot_3_prr_real robot_3_prr_least")[0]
        + "void turn(int n, const float *x, float *s, float *c);\n"
        "void turn(int n, const float *x, float *s, float *c) { robot_3_prr_turn(n, x, s, c); }\n"
    )
    import ctypes

    x = np.concatenate([np.linspace(-4100, 4100, 4001), np.linspace(-4, 4, 2001), [1e9, -3e20]])
    x = x.astype(np.float32)
    for flags in ([], [SAME]):
        library = tmp_path / f"sines{len(flags)}.so"
        run([*compiler("gcc"), *STRICT, *flags, "-shared", "-fPIC", user, "-o", library, "-lm"])
        s, c = np.empty_like(x), np.empty_like(x)
        pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (x, s, c)]
        ctypes.CDLL(str(library)).turn(len(x), *pointers)
        for found, wanted in ((s, mpmath.sin), (c, mpmath.cos)):
            with mpmath.workprec(200):
                exact = np.array([float(mpmath.mpf(wanted(mpmath.mpf(float(each))))) for each in x])
            ulp = np.spacing(np.abs(exact).astype(np.float32)).astype(float)
            assert (np.abs(found - exact) / ulp).max() < 2


@pytest.mark.long
def test_floats_are_near_doubles(tmp_path):
    robot = built("delta")
    single = Library(robot, lw.export.c(robot, ["motion"], precision="float"), tmp_path)
    v, u = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    status, [dq, dv] = single("motion", robot.home.q, v, u)
    assert status == 0
    np.testing.assert_allclose(dv, robot.kernel("motion")(robot.home.q, v, u)[1], rtol=2e-5)
    assert dq.dtype == np.float32


def test_what_is_written_beside_the_source():
    files = lw.export.c(built("prr3"), ["motion", "jacobian"], misra=True).files
    assert {*files} == {
        *("robot_3_prr.h", "robot_3_prr.c", "robot_3_prr_selftest.c"),
        *("CMakeLists.txt", "robot_3_prr.pc.in", "README.md", "MISRA.md"),
    }
    assert "`robot_3_prr_jacobian`: Task Jacobian" in files["README.md"]
    assert "(CMake: `-D ROBOT_3_PRR_SAME_NUMBERS=ON`)" in files["README.md"]
    assert not any(re.search("LW_|lw_", text) for text in files.values())
    assert "MISRA.md" not in lw.export.c(built("prr3"), ["motion"]).files
    for text in files.values():
        assert not re.search(r"\b(lw|LW)_", text)
        assert len(text.splitlines()) > 5
    for word in ("malloc", "goto", "static lw_real"):
        assert word not in files["robot_3_prr.c"]
