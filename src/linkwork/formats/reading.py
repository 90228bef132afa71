"""How a model file is read: what its reader is told beside the file.

A file of a package is named by package://NAME/path (ROS) or model://NAME/path (SDF). It is looked
for in the folders that are stated and in the folders around the model's file that are called NAME;
nothing else is opened but what lies beside the model's file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from linkwork.checks import file_path
from linkwork.errors import LinkworkError
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism.refusal import shown

PACKAGES = ("package://", "model://")
FILE = "file://"
EARTH = (0.0, 0.0, -9.81)  # gravity where a file says none [m/s^2]


Paths: TypeAlias = Iterable[str | Path] | str | Path


def folders(paths: Paths, what: str) -> tuple[Path, ...]:
    """Return folders that are there, from several, or one text in which they are separated."""
    if isinstance(paths, str):
        paths = [part for part in paths.split(os.pathsep) if part]
    elif isinstance(paths, Path) or not isinstance(paths, Iterable):
        paths = [paths]
    found = tuple(file_path(each, f"a folder of {what}") for each in paths)
    for folder in found:
        if not folder.is_dir():
            raise LinkworkError(f"{what} holds '{folder}', which is no folder")
    return found


@dataclass(frozen=True)
class Reading:
    """Say how a model file is read.

    Attributes:
        floating: whether the root, which stands still otherwise, moves freely.
        packages: folders that hold packages, or are packages.
        merging: whether hinges that nearly meet are one joint, where the file's convention is so.
        includes: folders whose files a model file may include beside those of its own.
    """

    floating: bool = False
    packages: tuple[Path, ...] = ()
    merging: bool = True
    includes: tuple[Path, ...] = ()

    @classmethod
    def asked(
        cls,
        floating: bool = False,
        packages: Paths = (),
        merging: bool = True,
        includes: Paths = (),
    ) -> Reading:
        """Return how a file is read, checked.

        Args:
            floating, merging: as the attributes.
            packages, includes: folders, or one text with folders separated as in PATH.

        Raises:
            LinkworkError: no truth value, no path, or a folder that is not there.
        """
        for name, value in (("floating", floating), ("merging", merging)):
            if not isinstance(value, bool):
                raise LinkworkError(f"{name} is {shown(value)}; give True or False")
        return cls(
            floating,
            folders(packages, "the package path"),
            merging,
            folders(includes, "the path of includes"),
        )

    def found(self, uri: str, element: Element) -> Path:
        """Return the file or folder that an element of a model file names.

        Raises:
            MechanismError: there is none, or it lies outside the model's folder and the packages.
        """
        prefix = next((each for each in PACKAGES if uri.startswith(each)), "")
        if prefix:
            package, _, rest = uri.removeprefix(prefix).partition("/")
            roots = list(self._folders_of(package, element))
            if not roots:
                raise element.refusal(
                    f"there is no package {shortened(package)} around the file or in the package "
                    f"path; state the folder that holds it (packages=, --package-path)"
                )
        else:
            rest, folder = uri.removeprefix(FILE), element.file.parent
            roots = [folder, *self.packages]
        for root in roots:
            try:
                path, inside = (root / rest).resolve(), [each.resolve() for each in roots]
                if any(path.is_relative_to(each) for each in inside) and path.exists():
                    return path
            except (OSError, ValueError):
                continue
        raise element.refusal(
            f"{shortened(uri)} is not there, or lies outside the model's folder and the package "
            "path; state its folder (packages=, --package-path)"
        )

    def _folders_of(self, package: str, element: Element) -> Iterator[Path]:
        """Yield the folders that are a package of that name."""
        for folder in self.packages:
            if folder.resolve().name == package:
                yield folder
            if package not in ("", ".", "..") and (folder / package).is_dir():
                yield folder / package
        yield from (each for each in element.file.resolve().parents if each.name == package)


PLAIN = Reading()
"""A file read as it is, without packages."""
