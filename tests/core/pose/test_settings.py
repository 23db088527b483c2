"""The options of a refinement describe themselves: flags, checks and words are those of the fields."""

import argparse
import math
from dataclasses import fields, replace
from typing import get_args

import pytest

from core.cli.flags import add_settings_flags, settings_from
from core.cli.main import main
from core.errors import RefineError
from core.features.registry import AUTO, EXTRACTORS, MATCHERS
from core.pose import settings as module
from core.pose.settings import RefineSettings
from core.support.options import options_of

OPTIONS = options_of(RefineSettings)
NUMBERS = [field.name for field in fields(RefineSettings) if type(field.default) in (int, float)]


def test_every_field_says_what_it_is():
    assert list(OPTIONS) == [field.name for field in fields(RefineSettings)]
    assert all(len(option.help) > 10 and not option.help.endswith(".") for option in OPTIONS.values())
    assert "Raises" not in " ".join(option.whole_help for option in OPTIONS.values())


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_has_a_range_whose_ends_are_accepted_and_whose_outside_is_not(name):
    option = OPTIONS[name]
    assert option.low <= getattr(RefineSettings, name) <= option.high
    for soft in (option.soft_low, option.soft_high):
        assert soft is None or option.low <= soft <= option.high
    for value in (option.low, option.high):
        assert getattr(replace(RefineSettings(), **{name: value}), name) == value
    for value in (option.low - 1, option.high + 1, math.nan, math.inf):
        with pytest.raises(RefineError, match=f"^The option {name} is .*; give a.* from .* to .*[.]$"):
            RefineSettings(**{name: value})


def test_a_count_is_a_whole_number():
    with pytest.raises(RefineError, match=r"iterations is 2\.5; give a whole number from 1 to 100"):
        RefineSettings(iterations=2.5)


def test_the_words_are_those_of_the_type_and_of_the_registry():
    assert tuple(OPTIONS["final"].choices) == get_args(module.Final)
    assert tuple(OPTIONS["lens"].choices) == get_args(module.Lens)
    assert tuple(OPTIONS["features"].choices) == (*EXTRACTORS, AUTO)
    assert tuple(OPTIONS["matcher"].choices) == tuple(MATCHERS)
    assert all(choice.title and choice.text for option in OPTIONS.values() for choice in option.choices.values())


@pytest.mark.parametrize("name", ["final", "lens", "features", "matcher"])
def test_another_word_is_refused(name):
    with pytest.raises(RefineError, match=f"The option {name} is 'other'; give one of "):
        RefineSettings(**{name: "other"})


def test_every_flag_has_the_fields_help_and_gives_the_fields_value(capsys):
    parser = argparse.ArgumentParser()
    add_settings_flags(parser)
    for name, option in OPTIONS.items():
        assert "".join(option.help.split()) in "".join(parser.format_help().split()), "but for where its lines are broken"
        choice = next(reversed(option.choices), None)
        flag = "--" + name.replace("_", "-")
        if name in NUMBERS:
            assert getattr(settings_from(parser.parse_args([flag, f"{option.high:.0f}"])), name) == option.high
        elif choice and name in ("final", "lens"):
            assert getattr(settings_from(parser.parse_args([flag, choice])), name) == choice


def test_a_negative_seed_is_one_sentence_on_the_command_line(capsys, tmp_path):
    """No generator of random numbers takes it."""
    files = [str(tmp_path / name) for name in ("s.ply", "p.jpg", "c.json")]
    assert main(["refine", *files[:2], "--camera", files[2], "--seed", "-1"]) != 0
    said = capsys.readouterr().err
    assert "The option seed is -1" in said
    assert "Traceback" not in said
