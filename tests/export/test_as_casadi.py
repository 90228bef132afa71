"""Functions in CasADi's calling convention: CasADi takes them as its own."""

import casadi as ca
import numpy as np

from linkwork.export.as_casadi import as_casadi

from tests.export.compiled import STRICT, compiler, run


def test_casadi_takes_the_functions(tmp_path):
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    A = ca.densify(ca.horzcat(ca.sin(x) * p[0], ca.fmax(x, p[1]), ca.sqrt(x**2 + 1)))
    one = ca.Function("one", [x, p], [A, ca.sumsqr(x)], ["x", "p"], ["A", "s"])
    two = ca.Function("two", [x], [ca.cos(x)], ["x"], ["c"])
    wide = ca.diag(ca.vertcat(*[x * k for k in range(1, 14)])) + 1  # 1,482 ones
    sparse = ca.Function("sparse", [x], [ca.densify(wide)], ["x"], ["D"])
    source, header = as_casadi([one, two, sparse], "odd name 1")
    (tmp_path / "odd name 1.c").write_text(source)
    (tmp_path / "odd name 1.h").write_text(header)
    library = tmp_path / "own.so"
    given = ["-shared", "-fPIC", "-o", library, tmp_path / "odd name 1.c", "-lm"]
    run([*compiler("gcc"), *STRICT, "-Wmissing-prototypes", *given])
    here = [0.1, -2.0, 3.0]
    for function, values in ((one, (here, [2.0, 0.5])), (two, (here,)), (sparse, (here,))):
        own = ca.external(function.name(), str(library))
        assert own.name_in() == function.name_in() and own.name_out() == function.name_out()
        for found, wanted in zip(own.call(values), function.call(values), strict=True):
            assert found.shape == wanted.shape
            np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-15, atol=1e-15)
    # What is not given is zero.
    lonely = ca.external("two", str(library))
    assert np.array(lonely(0)).ravel().tolist() == [1.0, 1.0, 1.0]
