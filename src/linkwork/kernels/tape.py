"""A program as numbers that an interpreter carries out (`interpreter`).

Values are numbered: constants first, then inputs, then what is computed, in its order. The order is
that of the chains of operations that values end, and within it that of the operations, so that many
equal ones follow each other: a run of them is told once. As 64-bit words:

    evaluations so far, bytes of all values, of the constants and of the inputs, where operands
    begin [bytes], numbers of results; the constants; of each run its operation and how many there
    are, with -1 after the last; then, two in a word, the operands of all operations and the results
"""

from itertools import groupby

import numpy as np

from linkwork.kernels.body import LIBRARY
from linkwork.kernels.program import Program
from linkwork.kernels.simplify import chain_lengths

ARITY = {
    name: arity
    for arity, names in (
        (1, "neg sqrt fabs floor ceil sign not"),
        (2, "add sub mul div copysign fmin fmax lt le eq ne and or if_else_zero"),
        (3, "fma fms fnma select"),
    )
    for name in names.split()
} | LIBRARY
CODES = {name: code for code, name in enumerate(ARITY)}
HEAD = 6  # words before the constants
END = -1


def tape(program: Program) -> np.ndarray:
    """Return the tape of a program."""
    # Where each value is.
    nodes = program.nodes
    constants = [k for k, node in enumerate(nodes) if node.op == "const"]
    first = len(constants) + program.n_in
    depths, codes = chain_lengths(nodes), [CODES.get(node.op, END) for node in nodes]
    computed = [k for k, code in enumerate(codes) if code != END]
    computed.sort(key=lambda k: (depths[k], codes[k]))
    places = {k: place for place, k in enumerate(constants)}
    places |= {k: place for place, k in enumerate(computed, first)}
    for k, node in enumerate(nodes):
        if node.op == "input":
            places[k] = len(constants) + int(node.value)
    # Runs, operands and results.
    runs = [
        number
        for code, same in groupby(map(codes.__getitem__, computed))
        for number in (code, sum(1 for _ in same))
    ]
    operands = [places[a] for k in computed for a in nodes[k].args]
    results = [places[k] for k in program.results]
    indices = np.array([*operands, *results], np.int32)
    head = [0, 8 * (first + len(computed)), 8 * len(constants), 8 * program.n_in]
    start = 8 * (HEAD + len(constants) + len(runs) + 1)
    whole = [
        np.array([*head, start, len(results)], np.int64),
        np.array([nodes[k].value for k in constants], float).view(np.int64),
        np.array([*runs, END], np.int64),
        np.resize(indices, indices.size + indices.size % 2).view(np.int64),
    ]
    return np.concatenate(whole)
