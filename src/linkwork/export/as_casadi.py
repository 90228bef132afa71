"""CasADi functions as C in CasADi's own calling convention, by the one writer of C.

    int f(const double **arg, double **res, long long *iw, double *w, int mem)

and what tells of f: f_n_in, f_n_out, f_name_in, f_name_out, f_sparsity_in, f_sparsity_out, f_work,
so that `casadi.external` takes it. Inputs that are null are zero, outputs that are null are left
out. All inputs and outputs are dense, column by column.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca

from linkwork.export.c_helpers import OWN, used
from linkwork.export.identifiers import identifier
from linkwork.export.sines import turn_texts
from linkwork.export.statements import Dialect, functions_text
from linkwork.export.templates import filled
from linkwork.kernels.program import trace
from linkwork.kernels.simplify import simplify

TYPES = "const double **arg, double **res, long long *iw, double *w, int mem"


def as_casadi(functions: Sequence[ca.Function], name: str) -> tuple[str, str]:
    """Return source and header of functions that are all dense; name: of the files."""
    body = "\n".join(part for f in functions for part in (called(f), *facts(f)))
    heads = [f"{match};" for match in re.findall(r"^(?!static)\w.*\)(?=\n\{)", body, re.MULTILINE)]
    guard = f"{identifier(name).upper()}_H"
    header = "\n".join(
        [
            f"#ifndef {guard}\n#define {guard}\n\n#ifdef __cplusplus\n" + 'extern "C" {\n#endif\n',
            *heads,
            "\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n",
        ]
    )
    own = identifier(name)
    opening = f'#include "{name}.h"\n\n#include <math.h>\n#include <stdint.h>\n'
    text = "\n".join([opening, static_functions(functions), body])
    return re.sub(r"\blw_", f"{own}_", re.sub(r"\bLW_", f"{own.upper()}_", text)), header


def static_functions(functions: Sequence[ca.Function]) -> str:
    """Return static functions in double precision, and what they use; math.h and stdint.h go
    before.

    void lw_NAME_code(const lw_real *in0, ..., lw_real *out0, ...)
    """
    dialect = Dialect()
    code = [functions_text(simplify(trace(f)), f"lw_{f.name()}_code", dialect) for f in functions]
    body = "\n".join(code)
    parts = ["typedef double lw_real;\n", filled("arithmetic.c", dialect)]
    parts += turn_texts(dialect, body) + used(OWN, body)
    return "\n".join([*parts, body])


def called(f: ca.Function) -> str:
    """Return the function in CasADi's convention that calls the one that is written."""
    given = max(f.numel_in(i) for i in range(f.n_in()))
    spare = [f"    double spare{i}[{max(f.numel_out(i), 1)}];" for i in range(f.n_out())]
    words = [f"arg[{i}] ? arg[{i}] : nothing" for i in range(f.n_in())]
    words += [f"res[{i}] ? res[{i}] : spare{i}" for i in range(f.n_out())]
    return "\n".join(
        [
            f"int {f.name()}({TYPES})",
            "{",
            f"    static const double nothing[{max(given, 1)}] = {{0}};",
            *spare,
            "    (void)iw;\n    (void)w;\n    (void)mem;",
            f"    lw_{f.name()}_code({', '.join(words)});",
            "    return 0;\n}\n",
        ]
    )


def facts(f: ca.Function) -> list[str]:
    """Return what tells of a function: how many inputs and outputs, their names and shapes, and the
    working memory, of which none is needed."""
    found = []
    for side, count in (("in", f.n_in()), ("out", f.n_out())):
        of_name, of_shape = getattr(f, f"name_{side}"), getattr(f, f"size_{side}")
        rows = ", ".join(f"{{{of_shape(i)[0]}, {of_shape(i)[1]}, 1}}" for i in range(count))
        names = ", ".join(f'"{of_name(i)}"' for i in range(count))
        found += [
            f"long long {f.name()}_n_{side}(void)\n{{\n    return {count};\n}}\n",
            f"const char *{f.name()}_name_{side}(long long i)\n{{\n"
            f"    static const char *const names[] = {{{names}}};\n"
            f"    return i >= 0 && i < {count} ? names[i] : 0;\n}}\n",
            f"const long long *{f.name()}_sparsity_{side}(long long i)\n{{\n"
            f"    static const long long shapes[][3] = {{{rows}}};\n"
            f"    return i >= 0 && i < {count} ? shapes[i] : 0;\n}}\n",
        ]
    sizes = "long long *sz_arg, long long *sz_res, long long *sz_iw, long long *sz_w"
    filled_in = ((f.n_in(), "sz_arg"), (f.n_out(), "sz_res"), (0, "sz_iw"), (0, "sz_w"))
    lines = [f"    if ({name}) {{\n        *{name} = {k};\n    }}" for k, name in filled_in]
    head = f"int {f.name()}_work({sizes})"
    return [*found, "\n".join([head, "{", *lines, "    return 0;\n}\n"])]
