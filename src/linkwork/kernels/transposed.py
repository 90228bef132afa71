"""Moves between states stored one a row, without gaps, and vectors of states: as many rows as there
are lanes at once.

    block[k][lane] = rows[lane][k],        k < n

Few numbers a row are dealt from whole vectors that hold all of them. Of more, squares of rows are
transposed by exchanging halves, then quarters, ... of pairs of them: what no result needs of that
is not compiled.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import islice

from linkwork.kernels.lines import Lines

FEW = 3  # numbers a row that are dealt with fewer exchanges than squares take


def gather(
    lines: Lines, rows: str, n: int, block: str, read: Collection[int] | None = None
) -> None:
    """Append the move of dense rows of n numbers to a block; read: those that are needed there, all
    if left out."""
    for k, column in gathered(lines, rows, n, range(n) if read is None else read):
        lines.store(column, block, k)


def gathered(lines: Lines, rows: str, n: int, read: Collection[int]) -> Iterator[tuple[int, str]]:
    """Read dense rows of n numbers; yield the vectors of those that are needed, and of others
    beside them: number and name."""
    if not read:
        return
    if n <= FEW:
        parts = [_load(lines, rows, k * lines.width) for k in range(n)]
        for k in range(n):
            yield k, _dealt(lines, parts, [lane * n + k for lane in range(lines.width)])
        return
    parts = max(lines.width // 2, 2)  # lanes of what is read at a time
    for first in range(0, n, lines.width):
        if not any(k in read for k in range(first, first + lines.width)):
            continue
        square = _exchanged(lines, rows, n, first, parts)
        yield from enumerate(_transposed(lines, square, parts // 2)[: n - first], first)


def _exchanged(lines: Lines, rows: str, n: int, first: int, parts: int) -> list[str]:
    """Return a square of rows, from a column on, whose halves, where they are parts that are read
    at a time, are exchanged."""
    narrow = Lines(parts)
    narrow.text = lines.text
    found = [
        [_part(narrow, rows, lane, n, first + start, lines.width) for lane in range(lines.width)]
        for start in range(0, lines.width, parts)
    ]
    if parts == lines.width:
        return found[0]
    order = ", ".join(f"i32 {k}" for k in range(lines.width))
    mask = f"<{lines.width} x i32> <{order}>"
    return [
        lines.let(
            f"shufflevector {narrow.number} {half[lane]}, {narrow.number} {half[lane + parts]}, "
            f"{mask}"
        )
        for half in found
        for lane in range(parts)
    ]


def _part(narrow: Lines, rows: str, lane: int, n: int, first: int, lanes: int) -> str:
    """Read a part of a row; what lies beyond the row is the next one's, and of the last row is not
    read."""
    left = (lanes - lane) * n - first  # numbers up to the end of all rows
    if left <= 0 or first >= n:
        return "poison"
    return _load(narrow, rows, lane * n + first, min(left, narrow.width))


def scatter(lines: Lines, block: str, n: int, rows: str) -> None:
    """Append the move of a block to dense rows of n numbers."""
    scattered(lines, (lines.load(block, k) for k in range(n)), n, rows)


def scattered(lines: Lines, block: Iterable[str], n: int, rows: str) -> None:
    """Append the move of n vectors, by their names, to dense rows."""
    vectors = iter(block)
    if n <= FEW:
        parts = list(vectors)
        for k in range(n):
            flat = range(k * lines.width, (k + 1) * lines.width)
            places = [place % n * lines.width + place // n for place in flat]
            _store(lines, _dealt(lines, parts, places), rows, k * lines.width)
        return
    for first in range(0, n, lines.width):
        count = min(lines.width, n - first)
        square = list(islice(vectors, count))
        square += ["poison"] * (lines.width - count)
        for lane, row in enumerate(_transposed(lines, square, lines.width // 2)):
            _store(lines, row, rows, lane * n + first, count)


def _dealt(lines: Lines, parts: list[str], places: list[int]) -> str:
    """Return the vector of numbers at places of the vectors, counted through all of them."""
    width, found = lines.width, parts[0]
    taken = [place if place < width else None for place in places]
    for k, part in enumerate(parts[1:], 1):
        own = [place - k * width if place // width == k else None for place in places]
        order = [
            width + mine if mine is not None else lane if k > 1 else before
            for lane, (mine, before) in enumerate(zip(own, taken, strict=True))
        ]
        found = _shuffled(lines, found, part, order)
    return found


def _transposed(lines: Lines, square: list[str], distance: int) -> list[str]:
    """Return the transpose of a square of vectors, of which pairs at larger distances are exchanged
    already."""
    while distance:
        after = list(square)
        for i in range(lines.width):
            if i & distance:
                continue
            a, b = square[i], square[i + distance]
            low = [
                lines.width + lane - distance if lane & distance else lane
                for lane in range(lines.width)
            ]
            high = [
                lines.width + lane if lane & distance else lane + distance
                for lane in range(lines.width)
            ]
            after[i], after[i + distance] = (_shuffled(lines, a, b, way) for way in (low, high))
        square, distance = after, distance // 2
    return square


def _shuffled(lines: Lines, a: str, b: str, order: Sequence[int | None]) -> str:
    if a == b == "poison":
        return "poison"
    told = ", ".join("i32 poison" if k is None else f"i32 {k}" for k in order)
    mask = f"<{lines.width} x i32> <{told}>"
    return lines.let(f"shufflevector {lines.number} {a}, {lines.number} {b}, {mask}")


def _load(lines: Lines, rows: str, place: int, count: int | None = None) -> str:
    """Read a vector of single numbers from a place on; no more than count of them."""
    address = lines.let(f"getelementptr inbounds double, ptr {rows}, i64 {place}")
    if count is None or count == lines.width:
        return lines.let(f"load {lines.number}, ptr {address}, align 8")
    return lines.let(
        f"call {lines.number} @llvm.masked.load.v{lines.width}f64.p0(ptr {address}, i32 8, "
        f"{_mask(lines, count)}, {lines.number} poison)"
    )


def _store(lines: Lines, value: str, rows: str, place: int, count: int | None = None) -> None:
    address = lines.let(f"getelementptr inbounds double, ptr {rows}, i64 {place}")
    if count is None or count == lines.width:
        lines.do(f"store {lines.number} {value}, ptr {address}, align 8")
        return
    lines.do(
        f"call void @llvm.masked.store.v{lines.width}f64.p0({lines.number} {value}, "
        f"ptr {address}, i32 8, {_mask(lines, count)})"
    )


def _mask(lines: Lines, count: int) -> str:
    bits = ", ".join(f"i1 {str(lane < count).lower()}" for lane in range(lines.width))
    return f"{lines.truth} <{bits}>"
