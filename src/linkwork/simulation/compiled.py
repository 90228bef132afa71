"""Compile a function by Numba once per machine: kept in a cache folder, and announced while it
happens.

Numba renews its cache when the file of a function changes. A function is made of others, too, that
are inlined or linked into it, and of constants; here the cache is renewed when any of them changes,
in whatever file they are. Kinds of machines that share a cache folder have files of their own in
it.
"""

import hashlib
import pickle
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from numba import njit, types
from numba.core import event
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.imputils import lower_builtin
from numba.core.registry import cpu_target
from numba.core.runtime.nrt import rtsys
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature

from linkwork.kernels.module import uncollected
from linkwork.patience import ongoing

TAUGHT: list[FunctionType] = []  # what generates the code of operators that Numba is taught here

ARITHMETIC = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


class _Part(JITCodeLibrary):
    """Hold a function that compiled code takes in; it is neither optimized nor made machine code of
    by itself, but with the `_Whole`, once.

    It is inlined where it asks for that (`INLINED`), and called otherwise: then its code is left
    out of those that call it.
    """

    def __init__(self, codegen, name: str, called: bool):
        super().__init__(codegen, name)
        self.called, self.calls = called, []

    def finalize(self):
        if self.called:  # what is taken in keeps its own ways
            for function in self.get_defined_functions():
                function.add_function_attribute("noinline")
        taken = dict.fromkeys(self._linking_libraries)
        inlined = [part for part in taken if not (isinstance(part, _Part) and part.called)]
        further = [each for part in inlined if isinstance(part, _Part) for each in part.calls]
        self.calls = list(dict.fromkeys([part for part in taken if part not in inlined] + further))
        self._linking_libraries = inlined
        super().finalize()

    def _optimize_final_module(self):
        pass

    def _finalize_final_module(self):
        self._finalized = True


class _Whole(JITCodeLibrary):
    """Hold a function that Python calls, with all of its parts: callers stand before the called."""

    def finalize(self):
        parts = list(dict.fromkeys(self._linking_libraries))
        for part in parts:
            parts += [each for each in getattr(part, "calls", ()) if each not in parts]
        self._linking_libraries = parts
        super().finalize()


@register_pass(mutates_CFG=False, analysis_only=True)
class _Introduce(AnalysisPass):
    """Make a function known to those that call it, without an address."""

    _name = "linkwork_introduce"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        lowered = state["cr"]
        # Something built in, of its own, that refuses all arguments: Numba asks for no less.
        entry = f"{{{lowered.fndesc.qualname} is called by compiled code alone}}".format
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return False


class _PartCompiler(Compiler):
    """Compile functions only to be taken in by others."""

    def define_pipelines(self):
        state = self.state
        state.flags.no_compile = True
        called, name = not state.flags.forceinline, state.func_id.func_qualname
        state.library = _Part(state.targetctx.codegen(), name, called)
        (passes,) = super().define_pipelines()
        passes.add_pass_after(_Introduce, NativeLowering)
        passes.finalize()
        return [passes]


class _WholeCompiler(Compiler):
    """Compile functions for Python."""

    def define_pipelines(self):
        state = self.state
        state.library = _Whole(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


OPTIONS = {
    **ARITHMETIC,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _PartCompiler,
    "forceinline": False,  # else it would be inherited from the first function that calls this one
}
INLINED = {**OPTIONS, "forceinline": True}


def compiled_once(what: str, signature) -> Callable[[Callable], Dispatcher]:
    """Decorate a function to be compiled for exactly one signature when its module is imported.

    The machine code is loaded from Numba's cache folder if it is there; if not, one line on stderr
    names `what` is being compiled. Where no cache folder can be used, a warning says so and the
    code is compiled for this process only.
    """

    def decorate(function: Callable) -> Dispatcher:
        with uncollected(), event.install_listener("numba:compile", _Announcer(what)):
            dispatcher = _cached(function, signature) or _uncached(what, function, signature)
        dispatcher.disable_compile()
        return dispatcher

    return decorate


def is_kept(function: Callable) -> bool:
    """Tell whether `compiled_once` will find a function in Numba's cache folder."""
    try:
        cache: Any = _dispatcher(function)._cache  # pyright: ignore[reportAttributeAccessIssue]
        return bool(cache._cache_file._load_index())
    except (RuntimeError, OSError, EOFError, pickle.UnpicklingError):
        return False


def entry_of(compiled: Dispatcher) -> Callable[..., Any]:
    """Return a function compiled once as one that Python calls at once, in half of the time: nobody
    looks whether its arguments are of the types that it is compiled for, as they have to be."""
    (found,) = compiled.overloads.values()
    return found.entry_point


def address_of(compiled: Dispatcher) -> int:
    """Return the address of a function compiled once, as C calls it."""
    (found,) = compiled.overloads.values()
    return found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)


def _cached(function: Callable, signature) -> Dispatcher | None:
    """Compile or load; return None where the cache folder cannot be used and nothing has been
    compiled yet."""
    try:
        dispatcher = _dispatcher(function)
    except RuntimeError:  # Numba found no folder that it may write to
        return None
    try:
        try:
            dispatcher.compile(signature)
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            # What is kept was written by another version of the file.
            dispatcher._cache.flush()  # pyright: ignore[reportAttributeAccessIssue]
            dispatcher.compile(signature)
    except OSError:  # the folder failed while being read or written
        return None
    return dispatcher


def _dispatcher(function: Callable) -> Dispatcher:
    """Return what compiles a function, or loads it from files that its fingerprint tells."""
    dispatcher = njit(cache=True, pipeline_class=_WholeCompiler, **ARITHMETIC)(function)
    cache: Any = dispatcher._cache  # pyright: ignore[reportAttributeAccessIssue]
    names = f"{cache._impl.filename_base}.{machine_digest()}"
    cache._cache_file = IndexDataCacheFile(cache.cache_path, names, fingerprint(function))
    # What is kept needs Numba's runtime alone: half a second is saved of reading in all that Numba
    # compiles with.
    rtsys.initialize(cpu_target.target_context)
    cache.load_overload = cache._load_overload
    return dispatcher


def machine_digest() -> str:
    """Return what tells kinds of machines apart that share a cache folder: each has files of its
    own.

    Numba keeps the code of all of them under one name and tells it apart by an index, which one
    machine may rewrite between another's two looks.
    """
    context: Any = cpu_target.target_context
    return hashlib.sha256(repr(context.codegen().magic_tuple()).encode()).hexdigest()[:16]


def taught(python: Callable, result: types.Type, *arguments: types.Type) -> Callable:
    """Teach Numba an operator on some types, by the function that generates its code."""
    shape = signature(result, *arguments)

    class Typing(ConcreteTemplate):
        cases = [shape]  # noqa: RUF012

    def register(generate: FunctionType) -> Callable:
        TAUGHT.append(generate)
        return lower_builtin(python, *arguments)(generate)

    infer_global(python)(Typing)  # pyright: ignore[reportOptionalCall]
    return register


def fingerprint(function: Callable) -> str:
    """Return a digest of a function's code, of that of all functions and constants that it names,
    and they name, of the structures that these read and write, and of how they are compiled, here.

    Operators are not named: those count that are taught in the modules of these functions.
    """
    parts: dict[Callable, list[object]] = {}
    _gather(function, parts)
    # Module by module, for those may be imported in any order.
    modules = sorted({part.__module__ for part in parts})
    for generate in [each for name in modules for each in TAUGHT if each.__module__ == name]:
        _gather(generate, parts)
    made_of = repr(list(parts.values())).encode()
    return hashlib.sha256(made_of + Path(__file__).read_bytes()).hexdigest()


def _gather(function: Callable, parts: dict[Callable, list[object]]) -> None:
    if not isinstance(function, FunctionType) or function in parts:
        return
    part: list[object] = [function.__module__]
    parts[function] = part
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    names = function.__globals__ | {name: cell.cell_contents for name, cell in cells.items()}
    for code in _codes(function.__code__):
        part += [
            code.co_code,
            code.co_names,
            [c for c in code.co_consts if not isinstance(c, CodeType)],
        ]
        for name in (*code.co_names, *code.co_freevars):
            value = names.get(name)
            if isinstance(value, bool | int | float | str | tuple):
                part += [name, value]
            elif isinstance(value, np.ndarray):
                part += [name, value.tolist()]
            elif isinstance(value, types.Type) or hasattr(value, "_fields"):
                part += [name, str(value), getattr(value, "_fields", ())]
            else:
                _gather(_python(value), parts)


def _python(value: object) -> Any:
    """Return the Python function of a compiled one or an intrinsic, or the value itself."""
    return getattr(value, "py_func", None) or getattr(value, "_defn", value)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and those of the functions that are defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _uncached(what: str, function: Callable, signature) -> Dispatcher:
    warnings.warn(
        f"{what} is compiled again by every process, for Numba's cache folder cannot be used:"
        " let the environment variable NUMBA_CACHE_DIR name a folder that can be written",
        stacklevel=4,
    )
    dispatcher = njit(pipeline_class=_WholeCompiler, **ARITHMETIC)(function)
    dispatcher.compile(signature)
    return dispatcher


class _Announcer(event.Listener):
    """Write one line while the outermost compilation lasts."""

    def __init__(self, what: str):
        self.what = what
        self.depth = 0
        self.started = 0.0

    def on_start(self, event):
        if self.depth == 0:
            self.started = time.perf_counter()
            self._write(f"linkwork: compiling {self.what} for this machine, once ...")
            self.run = ongoing.held()
            self.run.__enter__()
        self.depth += 1

    def on_end(self, event):
        self.depth -= 1
        if self.depth == 0:
            self._write(f" {time.perf_counter() - self.started:.1f} s\n")
            self.run.__exit__(None, None, None)

    def _write(self, text: str) -> None:
        sys.stderr.write(text)
        sys.stderr.flush()
