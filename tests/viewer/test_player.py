"""The clock of a run."""

import pytest

from linkwork.viewer.player import SPEEDS, Player


def test_it_plays_to_the_end_and_stops_there():
    player = Player.of(1.0, 3.0).toggled()
    assert player.advanced(0.5).time == pytest.approx(1.5)
    ended = player.advanced(0.5).advanced(2.0)
    assert (ended.time, ended.playing, ended.ended) == (3.0, False, True)
    assert ended.toggled().time == 1.0


def test_it_loops():
    player = Player(1.0, 3.0, 2.5, playing=True, looping=True)
    assert player.advanced(1.0).time == pytest.approx(1.5)
    assert player.advanced(5.0).time == pytest.approx(1.5)


def test_pause_and_scrub():
    player = Player.of(0.0, 2.0)
    assert player.advanced(1.0) == player
    assert player.toggled().toggled().playing is False
    assert [player.at(t).time for t in (-1, 0.7, 9)] == [0.0, 0.7, 2.0]


@pytest.mark.parametrize(
    ("name", "speed"), [("1/50", 0.02), ("1/2", 0.5), ("1", 1.0), ("10", 10.0)]
)
def test_speed(name, speed):
    player = Player.of(0.0, 100.0).at_speed(name).toggled()
    assert name in SPEEDS
    assert player.advanced(1.0).time == pytest.approx(speed)


@pytest.mark.parametrize("looping", [False, True])
def test_a_run_of_one_instant_stands_still(looping):
    player = Player(2.0, 2.0, 2.0, looping=looping).toggled()
    assert not player.playing
    assert Player(2.0, 2.0, 2.0, playing=True, looping=looping).advanced(1.0).time == 2.0
