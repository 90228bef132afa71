"""Words of commands that are wrong: one sentence, with the nearest word or what would be right."""

import pytest

from tests.cli.calls import call, refused

SENTENCES = {
    "simulate": "'linkwork simulate' needs ROBOT: a robot of the catalogue",
    "simulate prr3": "'linkwork simulate' needs --duration: length of the run, s",
    "simulat prr3": "there is no command 'simulat' (did you mean simulate?)",
    "analyse prr3 singularites": "there is no command 'singularites' (did you mean singularities?)",
    "analyse modes prr3": "there is no command 'prr3'; write 'linkwork analyse ROBOT COMMAND' with",
    "analyse prr3": "'linkwork analyse' needs a command: modes, singularities, workspace,",
    "nothing": "there is no command 'nothing'; write 'linkwork COMMAND' with one of the commands",
    "simulate prr3 --dur 3": "there is no option --dur (did you mean --duration?); see "
    "'linkwork simulate --help'",
    "simulate prr3 --qqq 3": "there is no option --qqq; see 'linkwork simulate --help'",
    "analyse prr3 modes --sed 1": "there is no option --sed (did you mean --seed?); see "
    "'linkwork analyse ROBOT modes --help'",
    "view prr3 --no-browsr": "there is no option --no-browsr (did you mean --no-browser?)",
    "--floating info prr3": "there is no option --floating; see 'linkwork --help'",
    "simulate prr3 --duration long": "--duration takes a number\n",
    "analyse prr3 modes --starts 1.5": "--starts takes a whole number\n",
    "simulate prr3 --duration 1 --method foo": "--method: 'foo' is not one of 'sharp_smart'",
    "simulate prr3 --duration": "option '--duration' requires an argument",
    "info prr3 --json=3": "option '--json' does not take a value",
    "analyse delta stiffness": "'linkwork analyse ROBOT stiffness' needs --joint-stiffness: of "
    "each joint, N/m or N m/rad: ",
    "analyse prr3 workspace --grid x=0:1:3,y=0,angle=0 --quantity det_A": "--quantity says what a "
    "picture shows; give --picture, too",
    "robots all": "'linkwork robots' takes no further word such as 'all'",
}


@pytest.mark.parametrize("words", SENTENCES)
def test_a_wrong_word_is_refused_in_one_sentence(words):
    said = refused(*words.split())
    assert said.startswith(f"linkwork: {SENTENCES[words]}")
    assert not set(said) & set("╭│╰")


def test_words_that_stand_the_other_way_round_are_turned():
    said = refused("analyse", "modes", "prr3")
    assert said.endswith("(did you mean 'linkwork analyse prr3 modes'?)\n")


def test_a_folder_is_no_robot_and_a_missing_file_is_named_once(tmp_path):
    assert f"'{tmp_path}' is a folder; give the file of a mechanism in it" in refused(
        "info", tmp_path
    )
    told = refused("info", "prr3", "--reference", tmp_path / "none.yaml")
    assert told.count("none.yaml") == 1
    assert "--forces holds 1 number; give 3" in refused(
        "simulate", "prr3", "--duration", 1, "--forces", 1
    )


@pytest.mark.parametrize("words", [(), ("analyse",)])
def test_no_words_show_the_help(words):
    result = call(*words)
    assert result.exit_code == 2
    assert "Usage:" in result.stdout + result.stderr
    assert "linkwork: " not in result.stderr


def test_a_debugged_refusal_of_words_tells_where_it_was_raised():
    result = call("simulate", "prr3", "--debug")
    assert result.exit_code == 2
    assert "Traceback" in result.stderr
