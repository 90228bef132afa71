"""Write the catalogue's page, docs/catalogue.md, from the robots themselves: python
docs/catalogue.py"""

import inspect
from collections.abc import Callable
from pathlib import Path
from textwrap import fill

from linkwork import Mechanism, Robot, robots
from linkwork.cli.catalogue import subject
from linkwork.cli.info import mobility, structure

PAGE = Path(__file__).with_name("catalogue.md")
COLUMNS = 100
HEAD = """# The catalogue

The robots of `linkwork.robots`, each a function that returns a `Mechanism`; its parameters are
dimensions and masses in SI units, described in its docstring. `linkwork robots` lists them,
`linkwork info NAME` tells more of one, `linkwork export NAME FILE.yaml` writes it as a [mechanism
file](mechanism-file.md) to start from.

```python
import linkwork as lw

robot = lw.Robot(lw.robots.five_bar())
print(robot.mobility, robot.independent)
```

In the pictures, made by `linkwork.views.plot_mechanism`, driven joints are orange and bear their
names. Revolute joints are cylinders about their axes (circles in the plane), prismatic joints
boxes, legs of variable length tubes with rods, universal joints crosses, spherical joints balls;
constraints of constant distance are thin rods, hatched is the ground.

"The paper" is Kordjazi, Akbarzadeh & Tahani, ICME 2010 (see the [README](../README.md)).

This page is written by `docs/catalogue.py`, its pictures are drawn by `docs/images.py`.
"""


def main() -> None:
    """Write the page."""
    PAGE.write_text(
        page({name: Robot(getattr(robots, name)()) for name in robots.__all__}), encoding="utf-8"
    )


def page(built: dict[str, Robot]) -> str:
    """Return the page for robots by the names of their functions."""
    return "\n".join(
        [HEAD, *(entry(name, getattr(robots, name), robot) for name, robot in built.items())]
    )


def entry(name: str, function: Callable[..., Mechanism], robot: Robot) -> str:
    """Return a robot's part of the page."""
    text = inspect.getdoc(function) or ""
    rows = {
        "Mobility": mobility(structure(robot)).replace("named below", "named here"),
        "Redundant rows": "; ".join(robot.redundant) or "none named",
        "Independent rates": ", ".join(
            f"`{rate}`{'' if rate in robot.actuators else ' (not driven)'}"
            for rate in robot.independent
        ),
        "Source": " ".join(text.partition("\nSource:")[2].split()),
        "Code": f"`lw.Robot(lw.robots.{name}())`",
    }
    table = "".join(f"| {title} | {value} |\n" for title, value in rows.items())
    return f"""## {name}

{fill(subject(text), COLUMNS)}

![{robot.mechanism.name}](images/catalogue/{name}.svg)

| | |
|---|---|
{table}"""


if __name__ == "__main__":
    main()
