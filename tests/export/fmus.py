"""FMUs as an importer has them: compiled by the machine's own C compiler, without a warning, and
driven by FMPy."""

from __future__ import annotations

import ctypes
import hashlib
import io
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from linkwork.export import FmuExport
from linkwork.export.fmi.description import source_names

from tests.export.compiled import STRICT, compiler, run

OWN = "x86_64-linux"
FOLDERS = {"3.0": OWN, "2.0": "linux64"}


def built(export: FmuExport, folder: Path, *flags: str) -> Path:
    """Return an FMU of sources with a binary for this machine, which is built once."""
    key = hashlib.sha256(export.content).hexdigest()[:16]
    place = folder / f"{export.name}_{key}"
    if place.is_dir():
        return place / f"{export.name}.fmu"
    place.mkdir()
    for path, content in export.files.items():
        if path.startswith("sources/"):
            (place / Path(path).name).write_bytes(content)
    library = place / f"{export.name}.so"
    options = [*STRICT, "-Wno-unused-parameter", "-O0", "-shared", "-fPIC", *flags, "-o", library]
    names = [place / name for name in source_names(export.name, export.version)]
    run([*compiler("gcc"), *options, *names, "-lm"])
    inside = f"binaries/{FOLDERS[export.version]}/{library.name}"
    whole = replace(export, files={**export.files, inside: library.read_bytes()})
    return whole.write(place / f"{export.name}.fmu")


def extracted(file: Path) -> str:
    """Return the folder of an FMU's files; a library that is loaded may not be written again."""
    folder = file.parent / "extracted"
    return str(folder) if folder.is_dir() else fmpy.extract(str(file), str(folder))


class Instance:
    """An instance of an FMU by the names of its variables, with the calls of either version."""

    def __init__(self, file: Path, me: bool = True, name: str = "one", token: str | None = None):
        self.description = fmpy.read_model_description(str(file))
        self.names = {v.name: v.valueReference for v in self.description.modelVariables}
        self.three = self.description.fmiVersion == "3.0"
        kinds = {(True, True): FMU3Model, (True, False): FMU3Slave}
        kinds |= {(False, True): FMU2Model, (False, False): FMU2Slave}
        interface = self.description.modelExchange if me else self.description.coSimulation
        self.said: list[str] = []
        self.own: Any = kinds[self.three, me](
            guid=self.description.guid if token is None else token,
            unzipDirectory=extracted(file),
            modelIdentifier=interface.modelIdentifier,
            instanceName=name,
        )
        self.start()

    def start(self) -> None:
        """Make the instance, with what it says kept."""
        if self.three:
            self.own.instantiate(logMessage=self.heard3, loggingOn=True)
            return
        self.callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(self.heard2)
        self.callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self.callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.own.instantiate(callbacks=self.callbacks, loggingOn=True)

    def heard3(self, environment, status, category, message) -> None:
        self.said.append(message.decode())

    def heard2(self, environment, name, status, category, message) -> None:
        self.said.append(message.decode())

    def initialise(self, tolerance: float | None = None, **values: float) -> None:
        """Go through the initialisation with start values; dots in names are underscores twice."""
        if self.three:
            self.own.enterInitializationMode(tolerance=tolerance)
        else:
            self.own.setupExperiment(tolerance=tolerance)
            self.own.enterInitializationMode()
        for name, value in values.items():
            self.set(name.replace("__", "."), value)
        self.own.exitInitializationMode()

    def go(self, **values: float) -> None:
        """Go on to the integration of a model exchange."""
        self.initialise(**values)
        self.update()
        self.own.enterContinuousTimeMode()

    def update(self) -> bool:
        """Handle an event; return whether the states changed."""
        if self.three:
            return self.own.updateDiscreteStates()[3]
        return bool(self.own.newDiscreteStates()[3])

    def set(self, name: str, value: float) -> None:
        if name == "start_at_tool":
            self.own.setBoolean([self.names[name]], [value])
        else:
            set = self.own.setFloat64 if self.three else self.own.setReal
            set([self.names[name]], [value])

    def get(self, *names: str) -> np.ndarray:
        get = self.own.getFloat64 if self.three else self.own.getReal
        return np.array(get([self.names[name] for name in names]))

    @property
    def state_names(self) -> list[str]:
        return [each.derivative.name for each in self.description.modelVariables if each.derivative]

    def states(self) -> np.ndarray:
        x = (ctypes.c_double * len(self.state_names))()
        self.own.getContinuousStates(x, len(x))
        return np.array(x)

    def put(self, states: Sequence[float] | np.ndarray) -> None:
        x = (ctypes.c_double * len(states))(*states)
        self.own.setContinuousStates(x, len(x))

    def rates(self) -> np.ndarray:
        x = (ctypes.c_double * len(self.state_names))()
        get = self.own.getContinuousStateDerivatives if self.three else self.own.getDerivatives
        get(x, len(x))
        return np.array(x)

    def step(self, time: float, length: float) -> None:
        self.own.doStep(currentCommunicationPoint=time, communicationStepSize=length)

    def tangent(self, unknowns: Sequence[str], knowns: Sequence[str], seeds) -> np.ndarray:
        places = [[self.names[name] for name in part] for part in (unknowns, knowns)]
        return np.array(self.own.getDirectionalDerivative(*places, [*map(float, seeds)]))


def read(export: FmuExport) -> zipfile.ZipFile:
    """Return an FMU as the archive that it is."""
    return zipfile.ZipFile(io.BytesIO(export.content))
