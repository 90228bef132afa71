"""Object code kept on disk, so that a function is compiled once per machine; and whatever else
takes long to find, by those who know what it depends on.

An entry is one file, named by the hash of all that its content depends on: the function, the
machine, the version of LLVM and the source of this package. It holds a line that marks the format,
the hash of the rest, and the rest; a file that does not agree with its own hash is not used. Files
are written under another name and renamed, so that a reader never sees half of one. Where all
entries together grow larger than a gigabyte the oldest are taken away.
"""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import resources
from pathlib import Path

import platformdirs

_MARK = b"linkwork kernel 1\n"
_HASH_BYTES = hashlib.sha256().digest_size

LARGEST = 2**30  # bytes of all entries together, about
SWEEPING = "00"  # what the names of entries begin with whose writers look at that, one in 256


def folder() -> Path:
    """Return the folder of the entries: LINKWORK_CACHE_DIR, or the user's cache folder of this
    system."""
    return Path(os.environ.get("LINKWORK_CACHE_DIR") or platformdirs.user_cache_dir("linkwork"))


def key(*parts: str) -> str:
    """Return the name of the entry that depends on `parts` and on the source of this package."""
    digest = hashlib.sha256(_source())
    for part in parts:
        encoded = part.encode()
        digest.update(len(encoded).to_bytes(8, "little") + encoded)
    return digest.hexdigest()


def kept(name: str, make: Callable[[], bytes]) -> tuple[bytes, bool]:
    """Return the content of an entry, made and written where there is none; and whether it was
    there."""
    content = read(name)
    if content is not None:
        return content, True
    content = make()
    write(name, content)
    return content, False


def read(name: str) -> bytes | None:
    """Return the content of an entry, or None where there is none or it is damaged
    (with a warning)."""
    path = _path(name)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    marked = data.removeprefix(_MARK)
    checksum, content = marked[:_HASH_BYTES], marked[_HASH_BYTES:]
    if data.startswith(_MARK) and checksum == hashlib.sha256(content).digest():
        return content
    warnings.warn(
        f"The cached kernel {path} is damaged; it is compiled anew.", RuntimeWarning, stacklevel=4
    )
    return None


def write(name: str, content: bytes) -> None:
    """Write an entry; warn once for a folder that cannot be written."""
    path = _path(name)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f"{name}.", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_MARK + hashlib.sha256(content).digest() + content)
            os.replace(temporary, path)
            if name.startswith(SWEEPING):
                with suppress(FileNotFoundError):  # another process sweeps, too
                    sweep()
        except OSError:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        _warn_unwritable(path.parent, error.strerror or str(error))


def sweep() -> None:
    """Take away the oldest entries where all together are larger than LARGEST."""
    with os.scandir(folder()) as entries:
        found = [(each.path, each.stat()) for each in entries if each.name.endswith(".kernel")]
    over = sum(state.st_size for _, state in found) - LARGEST
    for path, state in sorted(found, key=lambda entry: entry[1].st_mtime):
        if over <= 0:
            return
        Path(path).unlink(missing_ok=True)
        over -= state.st_size


@cache
def _warn_unwritable(place: Path, reason: str) -> None:
    warnings.warn(
        f"Kernels cannot be cached in {place} ({reason}) and are compiled at every start;"
        " set LINKWORK_CACHE_DIR to a folder that can be written.",
        RuntimeWarning,
        stacklevel=5,
    )


def _path(name: str) -> Path:
    return folder() / f"{name}.kernel"


def _source() -> bytes:
    """Return what the source of this package is told by: other source makes other code."""
    return source("linkwork.kernels")


@cache
def source(package: str) -> bytes:
    """Return a digest of the source of a package: other source makes other code."""
    digest, folder = hashlib.sha256(), Path(str(resources.files(package)))
    for file in sorted(folder.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()
