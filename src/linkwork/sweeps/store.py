"""The store: a Zarr group with the results of a study, written chunk by chunk and read by
`xarray.open_zarr`.

Its arrays are those of `Bench.fields`, in chunks along "member" that are the study's. The array
"checksum" tells which are finished: it is written last, so that whatever ends the program at any
moment, a chunk is finished or done again.
"""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from linkwork.sweeps.chunk import Results, digest
from linkwork.sweeps.preparation import Bench
from linkwork.sweeps.study import Study, StudyError

if TYPE_CHECKING:
    import zarr

CHECKSUM = "checksum"
STUDY, PROGRAM = "study", "linkwork"
DESCRIPTION = "zarr.json"


@dataclass(frozen=True, eq=False)
class Store:
    """Hold the results of a study on disk; begun_by: the version of the program that made the
    store."""

    path: Path
    bench: Bench
    arrays: Mapping[str, zarr.Array]
    begun_by: str

    @classmethod
    def open(cls, path: Path, bench: Bench) -> Store:
        """Open the store of a study, or make it, whole or not at all; what is damaged of its
        descriptions is mended.

        Raises:
            StudyError: a store of another study, something that is no store, a place that cannot be
                written.
        """
        if not path.exists():
            create(path, bench)
        group, arrays = opened(path, bench)
        if (text := group.attrs.get(STUDY)) != bench.study.text:
            raise StudyError(
                f"{path} holds the results of another study ({other(text, bench.study)}); give "
                "another folder, or remove it"
            )
        wanted = {
            name: bench.shape(field, bench.study.members) for name, field in bench.fields.items()
        }
        if {name: getattr(array, "shape", None) for name, array in arrays.items()} != wanted | {
            CHECKSUM: (bench.study.chunks,)
        }:
            raise StudyError(
                f"{path} was written by another version of the program; give another folder, or "
                "remove it"
            )
        mend(path, bench)
        group, arrays = opened(path, bench)
        name_axes(path, group, bench)
        return cls(path, bench, arrays, str(group.attrs.get(PROGRAM)))

    def require_this_version(self) -> None:
        """Refuse to add to what another version of the program computed: members might differ."""
        if self.begun_by != version(PROGRAM):
            raise StudyError(
                f"{self.path} was begun by version {self.begun_by} of the program, and this is "
                f"{version(PROGRAM)}, whose numbers may differ; go on with that one, or give "
                "another folder"
            )

    def rows(self, index: int) -> slice:
        """Return the members of a chunk."""
        length = self.bench.study.chunk_length
        return slice(index * length, min((index + 1) * length, self.bench.study.members))

    def read(self, index: int) -> Results:
        """Return the arrays of a chunk by name."""
        return {name: np.asarray(self.arrays[name][self.rows(index)]) for name in self.bench.fields}

    def write(self, index: int, results: Results) -> None:
        """Write the arrays of a chunk, and last its checksum.

        Raises:
            StudyError: the disk is full or otherwise not writable; what was finished before stays
                so.
        """
        with written(self.path):
            self.arrays[CHECKSUM][index] = 0
            for name, values in results.items():
                self.arrays[name][self.rows(index)] = values
            self.arrays[CHECKSUM][index] = np.uint64(digest(results))

    def state(self, index: int) -> str:
        """Return "finished", "open", or "corrupted": finished once, but what is on disk is not what
        was written."""
        try:
            found = int(np.asarray(self.arrays[CHECKSUM][index]))
            if not found:
                return "open"
            return "finished" if found == digest(self.read(index)) else "corrupted"
        except Exception:  # likewise
            return "corrupted"


def create(path: Path, bench: Bench) -> None:
    """Make an empty store beside its place, and put it there when it is complete, if no other
    process has put one there meanwhile."""
    # A folder beside the place, renamed when all is there: nobody sees half a store.
    part = path.with_name(f".{path.name}.{uuid4().hex[:8]}.part")
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            lay_out(part, bench)
            try:
                part.rename(path)
            except OSError:
                if not path.is_dir():
                    raise
        finally:
            shutil.rmtree(part, ignore_errors=True)


def opened(path: Path, bench: Bench) -> tuple[Any, dict[str, Any]]:
    """Return the group of a store, and its arrays of results by name.

    Raises:
        StudyError: something that is no store, or cannot be read.
    """
    import zarr

    try:
        with zarr.config.set({"array.write_empty_chunks": True}):
            group: Any = zarr.open_group(path, mode="r+")
            return group, {name: group[name] for name in (*bench.fields, CHECKSUM) if name in group}
    except Exception as error:  # whatever a decoder says of a file that is damaged
        raise StudyError(
            f"{path} is no store of a study that can be read ({reason(error)}); {left(path)}give "
            "another folder, or remove it"
        ) from None


def left(path: Path) -> str:
    """Say what can still be read of a store that does not tell its study any more."""
    names = sorted(each.parent.name for each in path.glob(f"*/{DESCRIPTION}"))
    if not names:
        return ""
    return f"whose results they are is lost, zarr.open_array reads {', '.join(names)} in it; "


def lay_out(place: Any, bench: Bench) -> None:
    """Make the group and the arrays of an empty store, in a folder or in memory."""
    import zarr

    # Whose results these are.
    study = bench.study
    about = {**told(study), PROGRAM: version(PROGRAM)}
    group = zarr.create_group(place, attributes=about)
    # An array for each field, a chunk of members in each file; a checksum marks finished chunks.
    for name, field in bench.fields.items():
        shape = bench.shape(field, study.members)
        chunks = (study.chunk_length, *shape[1:])
        add(group, name, shape, chunks, field.axes, field.kind, dict(field.attrs))
    finished = {"description": "of a finished chunk; else 0"}
    add(group, CHECKSUM, (study.chunks,), (1,), ("chunk",), "u8", finished)
    for axis, values in coordinates(bench).items():
        kind, attrs = ("f8", {"units": "s"}) if axis == "time" else (str, {})
        add(group, axis, values.shape, values.shape, (axis,), kind, attrs)[:] = values
    with warnings.catch_warnings():
        # xarray wants what version 3 of the format leaves open.
        warnings.simplefilter("ignore", UserWarning)
        zarr.consolidate_metadata(group.store)


def told(study: Study) -> dict[str, str]:
    """Return what a store tells of its study."""
    caveats = {"caveats": "\n".join(study.robot.caveats)} if study.robot.caveats else {}
    return {STUDY: study.text, "name": study.name} | caveats


def coordinates(bench: Bench) -> dict[str, np.ndarray]:
    """Return the times and the names along the axes of the results."""
    used = {axis for field in bench.fields.values() for axis in field.axes}
    names = {
        axis: np.array(found, dtype=object) for axis, found in bench.labels.items() if axis in used
    }
    return {"time": bench.times} | names


def mend(path: Path, bench: Bench) -> None:
    """Write anew the descriptions of a store's arrays, their own and those that the group's
    repeats, which are not those that its study asks for; how their files are packed stands."""
    # What the group tells, and what it would tell of a store that is made now.
    given = read_or_none(lambda: json.loads((path / DESCRIPTION).read_bytes()))
    found = read_or_none(lambda: given["consolidated_metadata"]["metadata"])
    if not isinstance(found, Mapping):
        raise StudyError(
            f"{path} does not describe its arrays any more; remove it, or give another folder"
        )
    empty: dict[str, Any] = {}
    lay_out(empty, bench)
    own = json.loads(empty[DESCRIPTION].to_bytes())["consolidated_metadata"]["metadata"]
    wanted = {name: each | packed(found.get(name)) for name, each in own.items()}
    with written(path):
        # Each array's own description, then the group's.
        for name, each in wanted.items():
            place = path / name / DESCRIPTION
            if read_or_none(lambda place=place: json.loads(place.read_bytes())) != each:
                place.parent.mkdir(exist_ok=True)
                place.write_text(json.dumps(each, indent=2))
        told_now = given["attributes"] | told(bench.study)
        if (found, given["attributes"]) != (wanted, told_now):
            repeated = given["consolidated_metadata"] | {"metadata": wanted}
            now = given | {"attributes": told_now, "consolidated_metadata": repeated}
            part = path / f".{DESCRIPTION}.{uuid4().hex[:8]}.part"
            part.write_text(json.dumps(now, indent=2))
            part.replace(path / DESCRIPTION)


def packed(description: Any) -> dict[str, Any]:
    """Return what an array's description tells of how its files are packed, which another version
    of zarr may do otherwise."""
    told = description if isinstance(description, Mapping) else {}
    return {name: told[name] for name in ("codecs",) if name in told}


def name_axes(path: Path, group: Any, bench: Bench) -> None:
    """Write anew times and names along the axes of a store that are not as they were made."""
    with written(path):
        for axis, values in coordinates(bench).items():
            if read_or_none(lambda axis=axis: list(group[axis][:])) != list(values):
                group[axis][:] = values


def other(text: Any, study: Study) -> str:
    """Return the name of the study that a store says it is of, and where that is the same what is
    not; what is no study is another program's."""
    try:
        found = Study.model_validate_json(text)
    except Exception:  # whatever is there in its place
        return "another program's, or of another version of this one"
    differing = [
        name for name in Study.model_fields if getattr(found, name) != getattr(study, name)
    ]
    told = f", with another {', '.join(differing)}"
    return found.name + told * (bool(differing) and "name" not in differing)


def read_or_none(read: Callable[[], Any]) -> Any:
    """Return what can be read; None if it cannot."""
    try:
        return read()
    except Exception:  # whatever a decoder says of a file that is damaged
        return None


def add(
    group: Any, name: str, shape, chunks, axes: tuple[str, ...], kind: Any, attrs: dict[str, Any]
) -> Any:
    """Make an array of a group."""
    return group.create_array(
        name,
        shape=shape,
        chunks=tuple(max(length, 1) for length in chunks),
        dtype=kind,
        fill_value=np.nan if kind == "f8" else "" if kind is str else 0,
        dimension_names=axes,
        attributes=attrs,
    )


@contextmanager
def written(path: Path) -> Iterator[None]:
    """Turn what keeps a store from being written into a sentence."""
    try:
        yield
    except OSError as error:
        raise StudyError(
            f"{path} cannot be written: {reason(error)}; what is finished is kept: the same "
            "command goes on from there"
        ) from None


def reason(error: Exception) -> str:
    """Say what was wrong, in a few words."""
    return " ".join(str(getattr(error, "strerror", None) or error).split()).lower()[:200]
