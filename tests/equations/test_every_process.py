"""What is derived, and the code that is made of it, is the same in every process, whatever order
Python walks through sets in."""

import hashlib
import os
from pathlib import Path

import pytest

from linkwork.equations import derive, functions
from linkwork.kernels import cache
from linkwork.kernels.emit import FUNCTIONS, module_text
from linkwork.kernels.machine import this_machine
from linkwork.kernels.program import trace
from linkwork.kernels.simplify import simplify

from tests.equations.test_flat_linkages import FLAT
from tests.kernels.graphs import random_function
from tests.processes import finished
from tests.robot.test_bearings import arm_of


def written() -> str:
    """Return what is found here: digests of code and of equations, homes, charts, a key."""
    texts = []
    for f in (random_function(1), random_function(1, 5000)):
        program = simplify(trace(f))
        texts += [module_text(program, this_machine(), kind) for kind in FUNCTIONS]
    texts.append(functions.motion(derive(arm_of().mechanism)).serialize())
    digests = [hashlib.sha256(text.encode()).hexdigest() for text in texts]
    flat = [derive(mechanism) for mechanism in FLAT.values()]
    homes = [(equations.reference.tolist(), str(equations.chart)) for equations in flat]
    return f"{digests} {homes} {cache.key(f.serialize(), this_machine().identity)}"


@pytest.mark.long
def test_equations_and_code_are_the_same_in_every_process():
    here = written()
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    words = "from tests.equations.test_every_process import written; print(written())"
    given = {"cwd": Path(__file__).parents[2], "env": os.environ | {"PYTHONHASHSEED": seed}}
    assert finished("-c", words, check=True, **given).stdout == f"{here}\n"
