"""The native file format: YAML with the fields of `Mechanism`, read safely.

The first key is `linkwork: 1`, the version of the format. Numbers are SI and radians. Defaults are left out.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.record import MechanismError

FORMAT_VERSION = 1


class Loader(yaml.SafeLoader):
    """Read plain data only, and refuse a key that is given twice."""


def _mapping(loader: Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    keys = [loader.construct_object(key, deep=True) for key, _ in node.value]
    for index, key in enumerate(keys):
        if key in keys[:index]:
            line = node.value[index][0].start_mark.line + 1
            raise MechanismError(f"line {line}: the key {key!r} is given twice; keep one of them")
    return yaml.SafeLoader.construct_mapping(loader, node, deep=True)


Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


class Dumper(yaml.SafeDumper):
    """Write vectors and small records on one line."""


def _flat(value: Any) -> bool:
    items = value.values() if isinstance(value, dict) else value
    return all(not isinstance(item, dict | list) for item in items)


Dumper.add_representer(
    list, lambda dumper, data: dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=_flat(data))
)
Dumper.add_representer(
    dict, lambda dumper, data: dumper.represent_mapping("tag:yaml.org,2002:map", data.items(), flow_style=_flat(data))
)


def read_yaml(path: Path) -> Mechanism:
    """Read a mechanism; every refusal begins with the file's name."""
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader)
    except OSError as error:
        raise MechanismError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        raise MechanismError(f"{path}: is not UTF-8 text; a mechanism file is YAML text") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark else ""
        raise MechanismError(f"{path}: {line}is not YAML: {getattr(error, 'problem', None) or error}") from None
    except MechanismError as error:
        raise MechanismError(f"{path}: {error}") from None
    if not isinstance(data, dict):
        raise MechanismError(f"{path}: holds no mechanism; the first line should be 'linkwork: {FORMAT_VERSION}'")
    version = data.pop("linkwork", None)
    if version != FORMAT_VERSION:
        raise MechanismError(f"{path}: linkwork: {version!r} is not a format version this program reads; give 1")
    try:
        return Mechanism(**{str(key): value for key, value in data.items()})
    except MechanismError as error:
        raise MechanismError(f"{path}: {error}") from None


def write_yaml(mechanism: Mechanism, path: Path) -> None:
    """Write a mechanism, atomically."""
    fields = mechanism.model_dump(mode="json", exclude_defaults=True)
    for name, joint in mechanism.joints.items():
        fields["joints"][name] = {"type": joint.type} | fields["joints"][name]
    text = yaml.dump(
        {"linkwork": FORMAT_VERSION} | fields, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=120
    )
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise MechanismError(f"{path}: cannot be written: {(error.strerror or str(error)).lower()}") from None
