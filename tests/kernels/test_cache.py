"""The cache: found, missed, damaged, not writable."""

import os
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import casadi as ca
import pytest

from linkwork.kernels import Kernel, cache, compile_function
from linkwork.kernels import kernel as kernel_module
from linkwork.kernels import module as modules
from linkwork.kernels.cache import key
from linkwork.kernels.machine import Machine, this_machine

from tests.kernels.graphs import random_function


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def simple(factor: float = 3.0) -> ca.Function:
    x = ca.SX.sym("x")
    return ca.Function("f", [x], [factor * ca.sin(x)])


def entry(folder: Path) -> Path:
    (file,) = folder.iterdir()
    return file


def assert_right(kernel: Kernel, factor: float = 3.0) -> None:
    assert kernel([0.5])[0] == pytest.approx(factor * 0.479425538604203, rel=1e-15)


def entries(folder: Path) -> int:
    return len(list(folder.iterdir())) if folder.exists() else 0


def test_the_second_kernel_comes_from_the_cache(folder: Path):
    first, second = compile_function(simple()), compile_function(simple())
    assert not first.from_cache
    assert second.from_cache
    assert second.operations == first.operations == 2
    assert second.compile_seconds < first.compile_seconds
    assert_right(second)


def test_another_function_is_another_entry(folder: Path):
    assert_right(compile_function(simple(3.0)))
    other = compile_function(simple(4.0))
    assert not other.from_cache
    assert_right(other, 4.0)
    assert entries(folder) == 2


def test_one_state_and_many_are_compiled_when_they_are_first_needed(folder: Path):
    kernel = compile_function(simple())
    assert entries(folder) == 0
    assert_right(kernel)
    assert entries(folder) == 1
    assert kernel([[0.5], [1.0]])[0].shape == (2, 1)
    assert entries(folder) == 2
    only_batches = compile_function(simple(4.0))
    assert only_batches.batch_address
    assert only_batches.operations == 2
    assert entries(folder) == 3
    assert only_batches.wide_address
    assert entries(folder) == 4


def test_the_program_is_made_once_for_all_kinds_and_not_at_all_from_the_cache(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    traced = []
    trace = kernel_module.trace
    monkeypatch.setattr(kernel_module, "trace", lambda f: traced.append(f) or trace(f))
    for _ in range(2):
        kernel = compile_function(simple())
        assert (
            kernel.address
            and kernel.batch_address
            and kernel.wide_address
            and kernel.operations == 2
        )
        assert len(traced) == 1


def test_threads_that_ask_at_once_compile_once(folder: Path, monkeypatch: pytest.MonkeyPatch):
    compiled = []
    object_code = modules.object_code

    def slow(text: str, machine: Machine) -> bytes:
        compiled.append(text)
        time.sleep(0.05)
        return object_code(text, machine)

    monkeypatch.setattr(modules, "object_code", slow)
    kernel = compile_function(simple())
    with ThreadPoolExecutor(8) as pool:
        addresses = list(
            pool.map(lambda k: kernel.batch_address if k % 2 else kernel.address, range(8))
        )
    assert len(compiled) == 2
    assert len(set(addresses)) == 2


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-9], lambda data: b"", lambda data: data[:-1] + b"?"]
)
def test_a_damaged_entry_is_compiled_anew(folder: Path, damage):
    assert_right(compile_function(simple()))
    file = entry(folder)
    file.write_bytes(damage(file.read_bytes()))
    with pytest.warns(
        RuntimeWarning, match=rf"The cached kernel {file} is damaged; it is compiled anew\."
    ):
        kernel = compile_function(simple())
        assert not kernel.from_cache
    assert_right(kernel)
    assert compile_function(simple()).from_cache


@pytest.mark.parametrize(
    "inside", [lambda tmp: tmp / "file" / "cache", lambda tmp: Path("/proc/none/cache")]
)
def test_a_folder_that_cannot_be_written_is_warned_of_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside
):
    (tmp_path / "file").write_text("not a folder")
    place = inside(tmp_path)
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(place))
    with pytest.warns(
        RuntimeWarning, match=rf"cannot be cached in {place} .* set LINKWORK_CACHE_DIR"
    ) as seen:
        kernels = [compile_function(simple(factor)) for factor in (1.0, 2.0, 2.0)]
        assert not any(kernel.from_cache for kernel in kernels)
    assert len(seen) == 1
    assert_right(kernels[1], 2.0)


def test_no_warning_and_no_leftover_when_all_is_well(folder: Path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in range(3):
            kernel = compile_function(random_function(seed))
            assert kernel.address and kernel.batch_address
    assert all(file.suffix == ".kernel" for file in folder.iterdir())


def test_the_oldest_entries_go_where_all_are_too_large(folder: Path, monkeypatch):
    monkeypatch.setattr(cache, "LARGEST", 2500)
    names, other = ("youngest", "middle", "oldest"), folder / "of_the_user.txt"
    for age, name in enumerate(names):
        cache.write(name, bytes(1000))
        os.utime(folder / f"{name}.kernel", (1e9 - age, 1e9 - age))
    other.write_text("no kernel" * 1000)
    os.utime(other, (0, 0))
    cache.write(cache.SWEEPING, b"")
    assert [cache.read(name) is not None for name in names] == [True, True, False]
    assert other.exists()


def test_the_key_separates_its_parts():
    assert key("ab", "c") != key("a", "bc")
    assert key("ab") == key("ab")


def another_kind(machine: Machine) -> dict[str, Machine]:
    """Return machines that differ from one in a single respect, and whose code this one can run."""
    fewer = machine.features.replace("+avx512f", "-avx512f").replace("+avx2", "-avx2") + ",-sse4a"
    return {
        "triple": replace(machine, triple=machine.triple.replace("-linux-gnu", "-linux")),
        "processor": replace(machine, cpu="generic"),
        "features": replace(machine, features=fewer),
    }


@pytest.mark.parametrize("part", ["triple", "processor", "features"])
def test_a_folder_shared_by_kinds_of_machines_gives_none_the_code_of_another(
    folder: Path, monkeypatch: pytest.MonkeyPatch, part: str
):
    other = another_kind(this_machine())[part]
    assert other != this_machine()
    assert compile_function(simple()).address
    with monkeypatch.context() as patch:
        patch.setattr(modules, "this_machine", lambda: other)
        kernel = compile_function(simple())
        assert not kernel.from_cache
        assert compile_function(simple()).from_cache
    assert entries(folder) == 2
    assert compile_function(simple()).from_cache


@pytest.mark.parametrize(
    ("of", "name", "value"),
    [
        ("llvmlite", "__version__", "0.0.1"),
        ("linkwork.kernels.cache", "_source", lambda: b"other source"),
    ],
)
def test_another_version_of_the_compiler_or_of_this_package_is_another_entry(
    folder: Path, monkeypatch: pytest.MonkeyPatch, of: str, name: str, value: object
):
    assert compile_function(simple()).address
    monkeypatch.setattr(f"{of}.{name}", value)
    kernel = compile_function(simple())
    assert not kernel.from_cache
    assert_right(kernel)
    assert entries(folder) == 2
