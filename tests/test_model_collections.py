"""The tool that runs collections of model files: it finds a difference where there is one."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

from tests.formats import samples
from tests.model_collections import (
    RIGHT,
    MuJoCoSide,
    PinocchioSide,
    apart,
    models_in,
    row_of,
    summary,
)

FINGERS = samples.URDF.replace("</robot>", "").replace(
    '<child link="ram"/>', '<child link="ram"/><mimic joint="shoulder" multiplier="0.2"/>'
)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("name", "text", "side"),
    [
        ("arm.urdf", samples.URDF, PinocchioSide),
        ("fingers.urdf", f"{FINGERS}</robot>", PinocchioSide),
        ("loop.xml", samples.FOUR_BAR, MuJoCoSide),
    ],
)
def test_models_move_as_the_other_engine_says_and_wrong_ones_do_not(name, text, side, tmp_path):
    path = tmp_path / name
    connect = '<connect body1="coupler" body2="rocker" anchor="0.3 0.3 0"/>'
    path.write_text(text.replace("{equality}", connect))
    mechanism = load(path).mechanism
    assert apart(lw.Robot(mechanism), side(path)) < RIGHT
    first = next(name for name, body in mechanism.bodies.items() if body.mass)
    body = mechanism.bodies[first]
    heavier = body.model_copy(update={"mass": 1.001 * body.mass})
    wrong = mechanism.model_copy(update={"bodies": {**mechanism.bodies, first: heavier}})
    assert apart(lw.Robot(wrong), side(path)) > 1e3 * RIGHT


def test_rows_of_files_that_run_and_of_files_that_are_refused(tmp_path):
    (tmp_path / "arm.urdf").write_text(samples.URDF)
    (tmp_path / "wrong.urdf").write_text("<robot name='r'/>")
    (tmp_path / "notes.xml").write_text("<notes/>")
    paths = models_in(tmp_path, "")
    assert [path.name for path in paths] == ["arm.urdf", "wrong.urdf"]
    good, bad = (row_of(path, 0.1, tmp_path) for path in paths)
    assert good["read"] == "yes" and good["run"] == "FINISHED" and float(good["end"]) == 0.1
    assert float(good["closure"]) == 0 and float(good["apart"]) < RIGHT
    assert bad["read"] == "refused" and "holds no links" in bad["run"]
    told = summary([good, bad, good | {"apart": "1e-3"}])
    assert "beside another engine: 2, apart without a word: 1" in told
    assert np.isfinite(float(good["cpu"]))
