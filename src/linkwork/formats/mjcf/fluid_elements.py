"""The fluid of a mechanism in MJCF, where MuJoCo's acts on the bodies as the mechanism's does.

MuJoCo's fluid acts on every body that has mass: on its ellipsoids, or on the box of its inertia.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.fluid import felt
from linkwork.formats import poses
from linkwork.formats.mjcf.carried_fluid import gap
from linkwork.formats.mjcf.fluid import COEFFICIENTS, sides_of
from linkwork.formats.mjcf.laws import number, numbers
from linkwork.formats.mjcf.model_plan import Seat
from linkwork.formats.mjcf.sheet import Sheet, placed
from linkwork.mechanism import Body, BoxDrag, EllipsoidDrag
from linkwork.mechanism.fluid import Drag

FLATTEST = 1e-3  # of sides, relative to the greatest
ALIKE = 1e-6  # of sides, places and products of inertia, relative to the greatest
SAME = 1e-12  # of fluid that is carried along


def write_fluid(sheet: Sheet) -> None:
    """Write what surrounds the bodies and the ellipsoids that it acts on, or note why not."""
    mechanism = sheet.mechanism
    if not felt(mechanism):
        return
    fault = unlike(sheet)
    if fault:
        sheet.notes.say(f"the fluid is left out: {fault}")
        return
    option, fluid = sheet.root.find("option"), mechanism.fluid
    assert option is not None
    option.set("density", number(fluid.density))
    option.set("viscosity", number(fluid.viscosity))
    option.set("wind", numbers(fluid.wind))
    for name, drag in mechanism.drags.items():
        if isinstance(drag, EllipsoidDrag):
            own = {
                "name": f"{name}.fluid",
                "type": "ellipsoid",
                "size": numbers(drag.radii),
                "group": "4",
                "fluidshape": "ellipsoid",
                "fluidcoef": numbers(getattr(drag, key) for key in COEFFICIENTS),
            }
            own |= placed(poses.of_frame(drag.frame))
            ET.SubElement(sheet.elements[drag.body], "geom", attrib=own)
            if gap(drag) > SAME:
                sheet.notes.say(
                    f"{name}: the fluid that MuJoCo has it carry along differs by {gap(drag):.1g}"
                )


def unlike(sheet: Sheet) -> str:
    """Say why MuJoCo's fluid would act otherwise; nothing where it would not."""
    drags = sheet.mechanism.drags.values()
    for seat in sheet.plan.seats.values():
        if not any(sheet.plan.seats[name].moves for name in sheet.plan.chain(seat.name)):
            continue
        body, own = sheet.mechanism.bodies[seat.body], drags_on(sheet, seat)
        if seat.share != 1 or seat.name in sheet.plan.light:
            return f"MuJoCo's would act on the mass that {seat.name} has in MJCF"
        if not body.mass and own:
            return f"MuJoCo's does not act on {seat.body}, which has no mass"
        if body.mass and not _as_in_mujoco(body, own):
            return (
                f"MuJoCo's would act on {seat.body} as on the box of its inertia, or on ellipsoids "
                "with the added masses of ellipsoids alone"
            )
    gone = {drag.body for drag in drags} - {seat.body for seat in sheet.plan.seats.values()}
    return f"{', '.join(sorted(gone))} is no body in MJCF" if gone else ""


def drags_on(sheet: Sheet, seat: Seat) -> list[Drag]:
    """Return what the fluid acts on at a seat."""
    return [drag for drag in sheet.mechanism.drags.values() if drag.body == seat.body]


def axes_of_box(sheet: Sheet, seat: Seat) -> np.ndarray | None:
    """Return the axes of the box of inertia on which the fluid acts, in which the inertia is
    written then; None without one."""
    drags = drags_on(sheet, seat)
    body = sheet.mechanism.bodies[seat.body]
    if len(drags) == 1 and isinstance(drags[0], BoxDrag) and _as_in_mujoco(body, drags):
        return poses.of_frame(drags[0].frame)[:3, :3]
    return None


def _as_in_mujoco(body: Body, drags: list[Drag]) -> bool:
    """Tell whether MuJoCo's fluid acts on a body as some drags do."""
    ellipsoids = [drag for drag in drags if isinstance(drag, EllipsoidDrag)]
    if ellipsoids:
        own = [drag for drag in ellipsoids if drag.added_mass or drag.added_inertia]
        return len(ellipsoids) == len(drags) and all(gap(drag) <= ALIKE for drag in own)
    box = drags[0] if len(drags) == 1 else None
    if not isinstance(box, BoxDrag) or body.inertia.planar or not body.mass:
        return False
    if min(box.size) < FLATTEST * max(box.size):  # the writer thickens what is flat
        return False
    X = poses.of_frame(box.frame)
    seen = X[:3, :3].T @ body.inertia.tensor() @ X[:3, :3]
    across = np.abs(seen - np.diag(np.diag(seen))).max()
    away = np.abs(X[:3, 3] - body.centre_of_mass).max()
    apart = np.abs(sides_of(np.diag(seen), body.mass) - box.size).max()
    return bool(across <= ALIKE * np.abs(seen).max() and max(away, apart) <= ALIKE * max(box.size))
