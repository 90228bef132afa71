"""Notes on what MuJoCo makes of a file otherwise than the mechanism that it was written from."""

from __future__ import annotations

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.sheet import GRADES, Sheet
from linkwork.mechanism import LoadedLength
from linkwork.mechanism.bearing import bearings, what_rubs

NEAR = 1e-9  # axes that agree [1]


def tell_differences(sheet: Sheet) -> None:
    """Note what MuJoCo takes otherwise than the mechanism."""
    tell_constraints(sheet)
    tell_effects(sheet)
    tell_joints(sheet)
    tell_left_out(sheet)


def tell_constraints(sheet: Sheet) -> None:
    """Note what MuJoCo's constraints are: soft, and without gamma for held tendons and curved
    gears."""
    say, kinds = sheet.notes.say, {tie.kind for tie in sheet.plan.ties}
    if kinds or sheet.mechanism.gears:
        say(
            "MuJoCo's loops are soft: accelerations differ by about 1e-4 of what the "
            "constraint forces do, and gaps open"
        )
    if "rod" in kinds:
        say(
            "rods are exact at rest only: MuJoCo leaves out what the rates add to the "
            "second derivative of a held tendon"
        )
    gears = sheet.mechanism.gears.items()
    lines = sheet.mechanism.transmissions.keys()
    curved = {
        "with powers": [name for name, gear in gears if any(map(any, gear.powers.values()))],
        "of lengths": [name for name, gear in gears if not lines.isdisjoint(gear.coupled)],
    }
    for kind, names in curved.items():
        if names:
            say(
                f"{', '.join(names)}: gears {kind} are exact at rest only: MuJoCo leaves out "
                "what the rates add to their second derivative"
            )


def tell_effects(sheet: Sheet) -> None:
    """Note what MuJoCo makes of friction, limits, stops and contacts."""
    say, effects = sheet.notes.say, [move.effects for move in sheet.moves.values()]
    if any(own.friction.coulomb for own in effects):
        say(
            "Coulomb friction is written as frictionloss, which holds still at rest instead "
            "of being smooth about rate zero"
        )
    if any(own.limits.bounded for own in effects):
        say("limits are stops in MuJoCo; here passing them is only reported")
    if any(own.limits.speed for own in effects):
        say("limits of speed are left out: MuJoCo has none")
    if any(own.friction.static or own.friction.bristle for own in effects):
        say("static friction and bristles are left out: MuJoCo has frictionloss alone")
    lines = sheet.mechanism.transmissions.values()
    loaded = [*effects, *(line for line in lines if isinstance(line, LoadedLength))]
    if any(any((*own.spring.pulls[GRADES:], *own.friction.smooth[GRADES:])) for own in loaded):
        say("powers of springs and dampers above the second are left out: MuJoCo has none")
    balls = [move.effects for move in sheet.moves.values() if move.kind == "ball"]
    if any(any(own.friction.powers) for own in balls):
        say("powers of the friction of balls are taken about each axis by itself in MuJoCo")
    if found := bearings(sheet.mechanism.joints):
        named, parts = ", ".join(found), what_rubs(found)
        say(f"{named}: the friction of {parts} is left out: MuJoCo has none that grows with load")
    if sheet.mechanism.contacts:
        say("contacts are left out: MuJoCo's follow another law, by solref and solimp")
    if any(own.stop for own in loaded):
        say("stops are left out: MuJoCo's limits follow another law, by solreflimit")


def tell_joints(sheet: Sheet) -> None:
    """Note what is closed, measured or joined otherwise."""
    # Joints that close loops.
    say = sheet.notes.say
    if closing := dict.fromkeys(
        tie.name.removesuffix(".near").removesuffix(".far")
        for tie in sheet.plan.ties
        if tie.kind == "connect"
    ):
        say(
            f"{', '.join(closing)}: closes a loop by a connect, which has no coordinates; read "
            "back they count from home, and may count in the other direction"
        )
    if welded := [tie.name for tie in sheet.plan.ties if tie.kind == "weld"]:
        say(
            f"{', '.join(welded)}: closes a loop by a joint that MuJoCo has in trees only; "
            "it leads to a part of its body, welded to it"
        )
    # Joints of the tree.
    balls = {
        move.name.removesuffix(".turn") for move in sheet.moves.values() if move.kind == "ball"
    }
    turned = [
        name
        for name in sheet.mechanism.joints
        if name in balls and sheet.home.turned(sheet.mechanism.pairs[name])
    ]
    if turned:
        say(
            f"{', '.join(turned)}: MuJoCo measures the turn of a ball joint from home, not "
            "from where the two frames agree"
        )
    if aside := [
        name for name in sheet.mechanism.joints if name in balls and _is_aside(sheet, name)
    ]:
        say(
            f"{', '.join(aside)}: MJCF has no axes of a ball joint but its body's; read back its "
            "rates are about these, as they stand at home"
        )
    free = [move.name for move in sheet.moves.values() if move.kind == "free"]
    if placed := [name for name in free if _is_placed(sheet, name)]:
        say(
            f"{', '.join(placed)}: MJCF has no frames of a free joint; read back its coordinates "
            "are those of its body in the world"
        )
    for name in sheet.plan.dropped:
        say(f"joints.{name}: holds nothing that the rest of the model does not, and is left out")
    for name in sheet.plan.floating:
        say(f"{name}: is reached by rods only and gets a free joint in MuJoCo")


def _is_aside(sheet: Sheet, name: str) -> bool:
    """Tell whether the axes of a ball joint that nothing drives are not its body's at home."""
    moves = (name, f"{name}.turn")
    body = next(
        seat.body
        for seat in sheet.plan.seats.values()
        if any(move.name in moves for move in seat.moves)
    )
    driven = any(rate.startswith(f"{name}.w") for rate in sheet.mechanism.actuators)
    near, _ = sheet.home.frames(sheet.mechanism.pairs[name])
    apart = np.abs(near[:3, :3] - sheet.home.poses[body][:3, :3]).max()
    return not driven and bool(apart > NEAR)


def _is_placed(sheet: Sheet, name: str) -> bool:
    """Tell whether a free joint has frames that are not those of ground and of its body."""
    joint = sheet.mechanism.pairs.get(name)
    if joint is None:
        return False
    frames = [poses.of_frame(frame) for frame in joint.frames]
    return any(np.abs(X - np.eye(4)).max() > NEAR for X in frames)


def tell_left_out(sheet: Sheet) -> None:
    """Note bodies and shapes that are not there."""
    say = sheet.notes.say
    gone = [body for body in sheet.mechanism.bodies if body not in sheet.plan.seats]
    if gone:
        say(
            f"{', '.join(gone)}: has no mass; its joints stand in the next body, as MJCF "
            "writes several joints at once"
        )
    unshown = [
        name
        for name, body in sheet.mechanism.bodies.items()
        if name in sheet.unshown or (name in gone and body.shapes)
    ]
    if unshown:
        say(
            f"{', '.join(unshown)}: has shapes that are left out: meshes of files that "
            "MuJoCo does not read, or those of a body that is no body in MJCF"
        )
