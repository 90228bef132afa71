"""A closed robot's tree without its loops, as a model of MuJoCo, with what makes it move as the
closed robot does.

The motors stand in the model as tendons of the joints that they move. While the engine runs, a
plug-in (`mujoco_plugin`) or a callback (`mujoco_callback`) replaces the tendons' lengths and
Jacobians by those of the loops, adds the inertia of the links that are cut away to the engine's,
and applies what these links, springs, friction and weight take.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.analysis.kept_tree import KeptTree, kept_tree
from linkwork.analysis.mujoco_callback import EngineCallback
from linkwork.analysis.mujoco_plugin import built, name_of, source
from linkwork.analysis.tree_map import TreeMap
from linkwork.errors import LinkworkError
from linkwork.formats import models
from linkwork.formats.mjcf.laws import law_of, number
from linkwork.formats.mjcf.writer import to_mjcf
from linkwork.formats.notes import Notes
from linkwork.model.charts import CompiledChart
from linkwork.model.state import State
from linkwork.robot import Robot

MODELS = models.FORMATS[0].suffixes


@dataclass(frozen=True, eq=False)
class PluggedTree:
    """Hold a tree of independent joints and the motors that move it through loops.

    tree: bodies, joints and how an engine holds them; map: what an engine is to add, as expressions
    """

    tree: KeptTree
    map: TreeMap

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the tree's rates, in the engine's order."""
        return self.tree.names

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the motors behind loops: tendons in the model."""
        return self.map.motors

    def write_mjcf(self, path: str | Path, *, plugin: bool = False) -> tuple[str, ...]:
        """Write the tree as an MJCF file without loops; return notes on what MuJoCo takes
        otherwise.

        Args:
            path: of the file, with a suffix of MJCF.
            plugin: whether the model asks for the plug-in, which is then to be loaded before; else
                a callback is to be set (`callback`).

        Raises:
            LinkworkError: another suffix, a folder that is not there, a joint that MJCF cannot
                hold.
        """
        checks.switch(plugin, "plugin")
        target = file_in_folder(path, MODELS, "MJCF")
        text, notes = to_mjcf(self.tree.mechanism, self.tree.home, self.tree.plan)
        root, said = ET.fromstring(text), Notes()
        self._add_motors(root, said)
        if plugin:
            self._ask_for_plugin(root)
        ET.indent(root)
        target.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
        if self.tree.spins:
            said.say(
                f"{', '.join(self.tree.spins)}: turns of rods about themselves, which have no "
                "angular momentum about their line here"
            )
        return *notes, *said.sentences()

    def callback(self, model: Any) -> EngineCallback:
        """Return what `mujoco.set_mjcb_passive` takes for a model of the file.

        Args:
            model: `mujoco.MjModel`; the tree's joints and tendons are known by their names.

        Raises:
            LinkworkError: MuJoCo is not installed; a model that lacks a joint or a tendon.
        """
        return EngineCallback(self.map, model)

    def write_plugin(self, path: str | Path) -> Path:
        """Write the plug-in as one C file, to be compiled with MuJoCo's headers and linked to it.

        path: of the C file.

        Raises:
            LinkworkError: another suffix than .c, a folder that is not there.
        """
        target = file_in_folder(path, (".c",), "the plug-in")
        target.write_text(source(self.map), encoding="utf-8")
        return target

    def build_plugin(self, path: str | Path) -> Path:
        """Compile the plug-in to a library for the MuJoCo that is installed; return its whole path,
        which `mujoco.mj_loadPluginLibrary` takes.

        Raises:
            LinkworkError: no C compiler (cc, or the one that CC names), no MuJoCo.
        """
        return built(source(self.map), checks.file_path(path, "the path").resolve())

    def _add_motors(self, root: ET.Element, notes: Notes) -> None:
        """Add the motors, as tendons that are those of the loops at rest in the model's home."""
        if not self.motors:
            return
        mechanism, (_, _, A) = self.tree.robot.mechanism, self.map.terms
        tendons, actuators = (section(root, name) for name in ("tendon", "actuator"))
        rows = self.at_home(A)
        for k, name in enumerate(self.motors):
            tendon = ET.SubElement(tendons, "fixed", name=name)
            for j in moved(A, k):
                ET.SubElement(tendon, "joint", joint=self.joints[j], coef=repr(float(rows[k, j])))
            tag, gear, law = law_of(mechanism, name, notes)
            ET.SubElement(actuators, tag, name=name, tendon=name, gear=number(gear), attrib=law)

    def _ask_for_plugin(self, root: ET.Element) -> None:
        name = name_of(self.map)
        extension = ET.Element("extension")
        plugin = ET.SubElement(extension, "plugin", plugin=name)
        ET.SubElement(plugin, "instance", name=name)
        root.insert(0, extension)
        body = root.find("worldbody/body")
        assert body is not None
        ET.SubElement(body, "plugin", instance=name)

    def at_home(self, expression: ca.SX) -> np.ndarray:
        """Return the value of an expression of q where the tree stands at first."""
        equations = self.tree.equations
        function = ca.Function("home", [equations.tree.q, equations.p], [ca.densify(expression)])
        return np.array(function(self.tree.about.q, self.map.p))

    def __repr__(self) -> str:
        return f"PluggedTree({', '.join(self.joints)} <- {', '.join(self.motors)})"


def plugged_tree(
    robot: Robot, chart: CompiledChart, motors: tuple[str, ...], about: State
) -> PluggedTree:
    """Return the tree that the independent rates of a chart span, and what drives it.

    Raises:
        LinkworkError: rates that span no tree; links that are cut away between two branches;
            motors that move with a free base.
    """
    equations = chart.facing(about.q).equations
    tree = kept_tree(robot, equations, motors, about)
    driven = dict.fromkeys((*motors, *robot.actuators))
    loops = [name for name in driven if name not in tree.names]
    found = PluggedTree(tree, TreeMap(tree, loops, robot.p))
    require_coupled(found)
    return found


def require_coupled(plugged: PluggedTree) -> None:
    """Refuse inertia that couples two branches, which an engine keeps apart, spins without inertia,
    and motors that move with free bases, which are in no tendon."""
    M, _, A = plugged.map.terms
    if not np.isfinite(plugged.at_home(M)).all():
        raise LinkworkError(
            f"{', '.join(plugged.tree.spins)}: turns of rods about themselves move no mass; give "
            "the rods inertia about their line, or a universal joint at one end"
        )
    for i, j in zip(*M.sparsity().get_triplet(), strict=True):
        if not plugged.tree.chains[i, j]:
            names = " and ".join(repr(plugged.joints[k]) for k in (i, j))
            raise LinkworkError(
                f"links that are cut away couple {names}, which are of two branches of the tree; "
                "name joints of one chain, so that the tree has none of the links of the other"
            )
    single = {move.name for move in plugged.tree.moves if move.kind != "free"}
    for k, motor in enumerate(plugged.motors):
        row = moved(A, k)
        other = [plugged.joints[j] for j in row if plugged.joints[j] not in single]
        if other or not row:
            what = f"moves with {other[0]!r}" if other else "moves with no joint of the tree"
            raise LinkworkError(
                f"the motor {motor!r} {what}; MuJoCo's tendons are of hinges and slides"
            )


def moved(A: ca.SX, k: int) -> list[int]:
    """Return which rates move a motor."""
    return sorted(j for i, j in zip(*A.sparsity().get_triplet(), strict=True) if i == k)


def section(root: ET.Element, name: str) -> ET.Element:
    """Return a section of a model, made where there is none."""
    found = root.find(name)
    return ET.SubElement(root, name) if found is None else found


def file_in_folder(path: str | Path, suffixes: tuple[str, ...], what: str) -> Path:
    """Return the path of a file to be written; refuse other suffixes and folders that are not
    there."""
    target = checks.file_path(path, "the path")
    if target.suffix not in suffixes or not target.parent.is_dir():
        raise LinkworkError(
            f"{what} is written to a file {suffixes[0]} in a folder that is there, not to "
            f"'{target}'"
        )
    return target
