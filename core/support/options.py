"""Options as dataclass fields that describe themselves: flags, tooltips and checks are all made from the field's metadata."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import GssmcError

_KEY = "option"  # of a field's metadata


@dataclass(frozen=True)
class Choice:
    """One of the words that an option takes: its name for people, and what it means."""

    title: str
    text: str


@dataclass(frozen=True)
class Option:
    """What an option is.

    help: a phrase without its full stop. low, high: the values that are accepted, both ends among them, None = no limit.
    soft_low, soft_high: the range that makes sense, for sliders, None = the whole. unit: of the number, "" for none.
    choices: the words that are accepted; none for an option that is no word, or any text.
    """

    help: str
    low: float | None = None
    high: float | None = None
    soft_low: float | None = None
    soft_high: float | None = None
    unit: str = ""
    choices: Mapping[str, Choice] = dataclasses.field(default_factory=dict)

    @property
    def whole_help(self) -> str:
        """The help, with what each of the words means."""
        words = "; ".join(f"{word} = {choice.text}" for word, choice in self.choices.items())
        return f"{self.help}: {words}" if words else self.help


def option(text: str, **more: Any) -> dict[str, Option]:
    """The metadata of a dataclass field; `more` is the Option's other values."""
    return {_KEY: Option(text, **more)}


def options_of(owner: Any) -> dict[str, Option]:
    """Name to Option of every field of a dataclass, or of an instance of one, in the fields' order."""
    return {field.name: field.metadata[_KEY] for field in dataclasses.fields(owner) if _KEY in field.metadata}


def check_options(owner: Any, error: type[GssmcError]) -> None:
    """Raises `error` when a value of the dataclass instance `owner` is none that its Option accepts."""
    for field in dataclasses.fields(owner):
        if _KEY in field.metadata:
            said = _complaint(field.name, getattr(owner, field.name), field.default, field.metadata[_KEY])
            if said:
                raise error(said)


def _complaint(name: str, value: Any, default: Any, option: Option) -> str:
    """What is wrong with `value`, as a sentence; "" when nothing is."""
    if option.choices and value not in option.choices:
        return f"The option {name} is '{value}'; give one of {', '.join(option.choices)}."
    low, high = option.low, option.high
    if low is None or high is None:
        return ""
    whole = isinstance(default, int)
    if low <= value <= high and (not whole or value == int(value)):  # NaN is in no range
        return ""
    return f"The option {name} is {value}; give {'a whole number' if whole else 'a value'} from {low:.10g} to {high:.10g}."
