"""Model files garbled by chance, the same for the same seed: structure, numbers, names, encodings,
ends cut off.

A file is garbled as a tree (elements of XML, mappings and lists of YAML) one to four times, then
now and then as bytes.
"""

from __future__ import annotations

import copy
import functools
import json
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree import ElementTree as ET

import yaml

import linkwork as lw
from linkwork.mechanism.files import written

from tests.formats import samples

NUMBERS = (
    *(
        "nan",
        "inf",
        "-inf",
        ".nan",
        ".inf",
        "1e400",
        "-1e400",
        "1e-400",
        "-0",
        "0",
        "-1",
        "1e308",
        "-1e308",
        "1e200",
    ),
    *(
        "1e160",
        "-1e120",
        "1e60",
        "1e30",
        "1e16",
        "1e-16",
        "1e-30",
        "1e-160",
        "1e-200",
        "5e-324",
        "9" * 400,
        "0x10",
    ),
    *(
        "1_000",
        "1,5",
        "",
        " ",
        "x",
        "1 2",
        "0 0 0",
        "1 2 3 4",
        "0 0 0 0",
        "1e200 0 0",
        "1e-200 0 0",
        "nan nan nan",
    ),
    *("3.141592653589793", "2147483648", "1e9", "true", "null", "~", "١", "1e-9"),
)
WORDS = (
    *(
        "",
        " ",
        "ground",
        "world",
        "a.b",
        ".",
        "..",
        "x" * 5000,
        "\x7f",
        "é",
        "字",
        "\u202e",
        "a/b",
        "$",
        "{}",
        "%s",
    ),
    *(
        "nan",
        "0",
        "null",
        "linkwork",
        "main",
        "../x.xml",
        "/etc/passwd",
        "model.xml",
        "home",
        "tip",
        "qw",
    ),
)
BYTES = (
    *(
        b"\x00",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"<",
        b">",
        b"&",
        b'"',
        b"]]>",
        b"<!DOCTYPE a>",
        b"<!--",
        b"&#0;",
        b"&x;",
    ),
    *(
        b"\n",
        b"\t",
        b"- ",
        b": ",
        b"*a",
        b"&a ",
        b"!!python/object:os.system ",
        b"[",
        b"{",
        b"|",
        b"%YAML 9\n",
        b"---\n",
    ),
    *(b"\xc3", b"\xed\xa0\x80", b"<include file='model.xml'/>", b"<<: ", b"\r", b"? "),
)
ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "latin-1", "cp037", "utf-7", "utf-8-sig")
MANY = (2, 30, 300)  # copies of an element
DEEP = (2, 40, 300)  # elements inside one another

PLUS = """<robot name="plus"><material name="red"><color rgba="1 0 0 1"/></material>\
<link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/><mass value="0.4"/>
<inertia ixx="0.002" iyy="0.003" izz="0.004" ixy="1e-4"/></inertial>
<visual><origin xyz="0 0 1"/><geometry><box size="0.1 0.2 0.3"/></geometry>\
<material name="red"/></visual></link>
<link name="b"><inertial><mass value="0.3"/>\
<inertia ixx="0.002" iyy="0.003" izz="0.004"/></inertial></link>
<link name="c"><inertial><mass value="0.3"/>\
<inertia ixx="0.002" iyy="0.003" izz="0.004"/></inertial></link>
<link name="tool"/>
<joint name="j" type="revolute" independent="true"><parent link="base"/><child link="a"/>\
<axis xyz="0 0 1"/>
<limit lower="-1" upper="1"/><dynamics damping="0.1" friction="0.2"/></joint>
<joint name="k" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/>\
<axis xyz="0 0 1"/></joint>
<joint name="l" type="prismatic"><parent link="base"/><child link="c"/><origin xyz="0.5 0 0"/>\
<axis xyz="0 1 0"/>
<mimic joint="j" multiplier="0.5" offset="0.1"/></joint>
<joint name="m" type="fixed"><parent link="b"/><child link="tool"/>\
<origin xyz="0.3 0 0" rpy="0 0 1"/></joint>
<loop name="tip" type="spherical"><predecessor link="b"><origin xyz="0.3 0 0"/></predecessor>
<successor link="c"><origin xyz="0 0.1 0"/></successor></loop>
<coupling name="gear"><predecessor link="a"/><successor link="b"/><ratio value="-2"/></coupling>
<transmission name="t"><joint name="j"/><actuator name="x"/></transmission></robot>"""
XML = samples.MODELS | {"plus.urdf": PLUS}
ROBOTS = (
    "prr3",
    "five_bar",
    "slider_crank",
    "bennett",
    "delta",
    "stewart",
    "andrews",
    "hydraulic_crane",
)


@functools.cache
def originals() -> dict[str, str]:
    """Return the texts that are garbled, by the name of the file."""
    known = [name for name in ROBOTS if name in lw.robots.__all__]
    return XML | {f"{name}.yaml": written(getattr(lw.robots, name)()) for name in known}


def garbled(seed: int) -> tuple[str, bytes]:
    """Return the name and the content of the file of a seed."""
    chance = random.Random(seed)
    names = sorted(originals())
    kind = ("xml", "urdf", "yaml")[seed % 3]
    name = chance.choice([name for name in names if name.endswith(kind)])
    text = originals()[name]
    if chance.random() < 0.85:
        with deep_recursion():
            text = (garbled_yaml if kind == "yaml" else garbled_xml)(text, chance)
    data = text.encode("utf-8", "surrogatepass")
    return name, garbled_bytes(data, chance) if chance.random() < 0.25 else data


@contextmanager
def deep_recursion() -> Iterator[None]:
    """Let copies of deep trees be made here, and nowhere else."""
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(20_000)
    try:
        yield
    finally:
        sys.setrecursionlimit(usual)


# ---------------------------------------------------------------------------------------------- XML


def garbled_xml(text: str, chance: random.Random) -> str:
    root = ET.fromstring(text)
    for _ in range(chance.randint(1, 4)):
        chance.choice(CHANGES)(root, chance)
    return serialised(root)


def serialised(root: ET.Element) -> str:
    """Return an element as text, without recursion; attributes are escaped, so that what is wrong
    is what they say."""
    parts: list[str] = []
    waiting: list[ET.Element | str] = [root]
    while waiting:
        item = waiting.pop()
        if isinstance(item, str):
            parts.append(item)
            continue
        attributes = "".join(f' {key}="{escaped(value)}"' for key, value in item.attrib.items())
        parts.append(f"<{item.tag}{attributes}>\n")
        waiting += [f"</{item.tag}>", *reversed(item)]
    return "".join(parts)


def escaped(value: str) -> str:
    for mark, entity in (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;")):
        value = value.replace(mark, entity)
    return value


def pick(root: ET.Element, chance: random.Random) -> tuple[ET.Element, ET.Element]:
    """Return an element and its parent."""
    return chance.choice(
        [(child, parent) for parent in root.iter() for child in parent] or [(root, root)]
    )


def drop(root: ET.Element, chance: random.Random) -> None:
    child, parent = pick(root, chance)
    if child is not parent:
        parent.remove(child)


def swap(root: ET.Element, chance: random.Random) -> None:
    """Let two elements change places, each with all inside it; an element and one inside it change
    tags and attributes."""
    (one, above), (two, beside) = pick(root, chance), pick(root, chance)
    if one is two or one in set(two.iter()) or two in set(one.iter()):
        one.tag, two.tag, one.attrib, two.attrib = two.tag, one.tag, two.attrib, one.attrib
        return
    i, j = list(above).index(one), list(beside).index(two)
    above[i], beside[j] = two, one


def double(root: ET.Element, chance: random.Random) -> None:
    """Repeat an element, under its own name or under others."""
    child, parent = pick(root, chance)
    if sum(1 for _ in child.iter()) > 40:
        return
    renamed = chance.random() < 0.5
    for number in range(chance.choice(MANY)):
        twin = copy.deepcopy(child)
        if renamed and "name" in twin.attrib:
            twin.set("name", f"{twin.get('name')}_{number}")
        parent.append(twin)


def nest(root: ET.Element, chance: random.Random) -> None:
    """Put an element into another, or copies of it into one another."""
    (child, parent), (target, _) = pick(root, chance), pick(root, chance)
    if chance.random() < 0.5 and target not in set(child.iter()) and child is not parent:
        parent.remove(child)
        target.append(child)
        return
    for number in range(chance.choice(DEEP)):
        inner = ET.Element(child.tag, dict(child.attrib))
        if "name" in inner.attrib:
            inner.set("name", f"{inner.get('name')}_{number}")
        child.append(inner)
        child = inner


def rename(root: ET.Element, chance: random.Random) -> None:
    (one, _), (two, _) = pick(root, chance), pick(root, chance)
    one.tag = two.tag if chance.random() < 0.8 else "blob"


def number(root: ET.Element, chance: random.Random) -> None:
    """Change one number of one attribute, or all of it."""
    places = [
        (element, key)
        for element in root.iter()
        for key, value in element.attrib.items()
        if _is_numbers(value)
    ]
    if not places:
        return
    element, key = chance.choice(places)
    words = element.attrib[key].split()
    if chance.random() < 0.7 and words:
        words[chance.randrange(len(words))] = chance.choice(NUMBERS)
        element.set(key, " ".join(words))
    else:
        element.set(key, chance.choice(NUMBERS))


def word(root: ET.Element, chance: random.Random) -> None:
    """Change an attribute to a word, to what another one says, or take it away; or say it under
    another's name."""
    places = [(element, key) for element in root.iter() for key in element.attrib]
    if not places:
        return
    (element, key), (other, name) = chance.choice(places), chance.choice(places)
    match chance.randrange(4):
        case 0:
            element.set(key, chance.choice(WORDS))
        case 1:
            element.set(key, other.attrib[name])
        case 2:
            del element.attrib[key]
        case _:
            element.set(
                name,
                other.attrib[name] if chance.random() < 0.5 else chance.choice((*NUMBERS, *WORDS)),
            )


def _is_numbers(value: str) -> bool:
    try:
        return bool([float(part) for part in value.split()])
    except ValueError:
        return False


CHANGES: tuple[Callable[[ET.Element, random.Random], None], ...] = (
    *(drop, swap, double, nest, rename),
    *(number, number, number, word, word),
)

# --------------------------------------------------------------------------------------------- YAML


def garbled_yaml(text: str, chance: random.Random) -> str:
    data = yaml.safe_load(text)
    for _ in range(chance.randint(1, 4)):
        _change(data, chance)
    return flowing(data, chance.random() < 0.1)


class Raw(str):
    """Stand for text that is written as it is, without quotes."""


def flowing(root: Any, anchored: bool) -> str:
    """Return data as YAML, its parts in brackets and braces; what is one object twice is an alias,
    if `anchored`."""
    parts: list[str] = []
    seen: dict[int, str] = {}
    waiting: list[Any] = [root]
    while waiting:
        item = waiting.pop()
        if isinstance(item, _Mark):
            parts.append(item)
        elif isinstance(item, dict | list):
            if anchored and id(item) in seen:
                parts.append(f"*{seen[id(item)]} ")
                continue
            seen[id(item)] = f"a{len(seen)}"
            anchor = f"&{seen[id(item)]} " if anchored else ""
            opening, closing = "{}" if isinstance(item, dict) else "[]"
            parts.append(anchor + opening)
            inside = (
                [(f"{json.dumps(str(key))}: ", part) for key, part in item.items()]
                if opening == "{"
                else item
            )
            waiting.append(_Mark(closing))
            for number, part in reversed(list(enumerate(inside))):
                key, part = part if opening == "{" else ("", part)
                waiting += [part, _Mark((",\n" if number else "") + key)]
        else:
            parts.append(item if isinstance(item, Raw) else json.dumps(item))
    return "".join(parts) + "\n"


class _Mark(str):
    """Stand for punctuation."""


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Yield all containers with a key of each."""
    waiting = [data]
    while waiting:
        item = waiting.pop()
        inside = (
            item.items()
            if isinstance(item, dict)
            else enumerate(item)
            if isinstance(item, list)
            else ()
        )
        for key, value in list(inside):
            yield item, key
            waiting.append(value)


def _change(data: Any, chance: random.Random) -> None:
    places = list(_places(data))
    if not places or len(places) > 20_000:
        return
    (holder, key), (other, name) = chance.choice(places), chance.choice(places)
    value = other[name]
    match chance.randrange(8):
        case 0:
            del holder[key]
        case 1 | 2 | 3:
            numbers = [(at, k) for at, k in places if isinstance(at[k], int | float)]
            at, k = chance.choice(numbers or places)
            at[k] = Raw(chance.choice(NUMBERS).strip() or "~")
        case 4:
            holder[key] = chance.choice(WORDS) if chance.random() < 0.6 else copy.deepcopy(value)
        case 5:
            holder[key], other[name] = copy.deepcopy(value), copy.deepcopy(holder[key])
        case 6:
            for number in range(chance.choice(MANY)):
                twin = holder[key] if chance.random() < 0.5 else copy.deepcopy(holder[key])
                if isinstance(holder, list):
                    holder.append(twin)
                else:
                    holder[f"{key}_{number}"] = twin
        case _:
            for _ in range(chance.choice(DEEP)):
                holder[key] = [holder[key]] if chance.random() < 0.5 else {str(name): holder[key]}


# -------------------------------------------------------------------------------------------- bytes


def garbled_bytes(data: bytes, chance: random.Random) -> bytes:
    """Return the content cut off, in another encoding, with bytes changed, put in or repeated."""
    at = chance.randrange(len(data) + 1)
    match chance.randrange(6):
        case 0:
            return data[:at]
        case 1:
            text = data.decode("utf-8", "replace")
            return text.encode(chance.choice(ENCODINGS), "replace")
        case 2:
            declared = f'<?xml version="1.0" encoding="{chance.choice(ENCODINGS)}"?>'.encode()
            return declared + data
        case 3:
            return data[:at] + bytes([chance.randrange(256)]) + data[at + 1 :]
        case 4:
            return data[:at] + chance.choice(BYTES) * chance.choice((1, 1, 500)) + data[at:]
        case _:
            other = chance.randrange(len(data) + 1)
            return data[:at] + data[min(at, other) : max(at, other)] + data[at:]
