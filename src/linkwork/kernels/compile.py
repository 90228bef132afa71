"""From LLVM instructions to machine code, and from machine code to functions that can be called."""

import ctypes
import ctypes.util
import os
from functools import cache

import llvmlite.binding as llvm

from linkwork.kernels.cache import kept, key
from linkwork.kernels.emit import LIBRARY
from linkwork.kernels.machine import Machine

# Functions that LLVM itself may call where the machine has no such instruction, and of memory.
_BESIDE = ("floor", "ceil", "malloc", "free", "memcpy")


def object_code(text: str, machine: Machine) -> bytes:
    """Return the relocatable object code of an LLVM module for a machine."""
    return _target_machine(machine).emit_object(_module(text))


def assembly(text: str, machine: Machine) -> str:
    """Return the assembly of an LLVM module for a machine."""
    return _target_machine(machine).emit_assembly(_module(text))


class Code:
    """Object code in memory: the addresses of its functions by name, which hold as long as this
    object lives.

    beside: addresses of what it needs and the C library has not, by name
    """

    def __init__(self, object_code: bytes, functions: tuple[str, ...], **beside: int):
        _initialize()
        # This linker keeps code and constants in one piece of memory, so that they always reach
        # each other.
        self._engine = llvm.create_lljit_compiler(use_jit_link=True)
        library = llvm.JITLibraryBuilder().add_object_img(object_code)
        for name in functions:
            library.export_symbol(name)
        for name, address in (_library_addresses() | beside).items():
            library.import_symbol(name, address)
        self._library = library.link(self._engine, "kernel")
        self.addresses: dict[str, int] = {name: self._library[name] for name in functions}


def shared_code(text: str, machine: Machine, functions: tuple[str, ...], **beside: int) -> Code:
    """Return the code of an LLVM module that serves all kernels, compiled or taken from the cache;
    functions, beside: as `Code` takes them."""
    content, _ = kept(key(text, machine.identity), lambda: object_code(text, machine))
    return Code(content, functions, **beside)


def _module(text: str) -> llvm.ModuleRef:
    module = llvm.parse_assembly(text)
    module.verify()
    return module


def _target_machine(machine: Machine) -> llvm.TargetMachine:
    _initialize()
    target = llvm.Target.from_triple(machine.triple)
    return target.create_target_machine(
        cpu=machine.cpu, features=machine.features, opt=2, reloc="pic", codemodel="small", jit=True
    )


@cache
def _initialize() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


@cache
def _library_addresses() -> dict[str, int]:
    """Return where the C library's functions are in this process."""
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)
    if not hasattr(library, "sin"):
        library = ctypes.CDLL(ctypes.util.find_library("m"))
    addresses = {
        name: ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        for name in (*LIBRARY, *_BESIDE)
    }
    return {name: address for name, address in addresses.items() if address}
