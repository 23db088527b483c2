"""From settings to the image side of a refinement: extractor, matcher, alignment, and the rule by which `auto` changes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Protocol, TypeVar

from ..errors import FeatureError
from .extractors.sift import RootSift
from .looks import Looks
from .matchers.nearest import MutualNearest
from .nets.process import NetProcess, Nets, RemoteExtractor, RemoteMatcher
from .registry import AUTO, EXTRACTORS, MATCHERS, ExtractorKind, MatcherKind, missing
from .subpixel import SubpixelAligner
from .types import Extractor, Features, Grey, Mask, Matcher

# What "auto" starts with, and what takes over where that finds no answer.
FIRST, STRONGER = "sift", "aliked"
NO_PATH = Path()
WIDE_RATIO = 0.9

Kind = TypeVar("Kind", ExtractorKind, MatcherKind)


class FeatureChoice(Protocol):
    """The part of the settings that says which features: names of the registry ("auto" too), model files ("" for none), and
    `threads` for networks, 0 = one per core.
    """

    @property
    def features(self) -> str: ...
    @property
    def matcher(self) -> str: ...
    @property
    def model(self) -> str: ...
    @property
    def matcher_model(self) -> str: ...
    @property
    def threads(self) -> int: ...


@dataclass(frozen=True)
class Frontend:
    """The image side of the method: extractor, matcher, alignment. A context manager that ends the process of its networks.

    `photo_extractor` sees the photo where that takes more than a render; None = the same.
    """

    extractor: Extractor = field(default_factory=RootSift)
    matcher: Matcher = field(default_factory=MutualNearest)
    aligner: SubpixelAligner = field(default_factory=SubpixelAligner)
    photo_extractor: Extractor | None = None
    process: NetProcess | None = None
    fallback: Frontend | None = None

    def photo_features(self, grey: Grey, mask: Mask | None = None) -> Features:
        """Features of the photo `grey` (H, W) uint8. Raises FeatureError."""
        return (self.photo_extractor or self.extractor).extract(grey, mask)

    def stronger(self, usable: int, views: int) -> Frontend | None:
        """What should look on, after an iteration in which `usable` of `views` held a pose and no answer came of it.

        None while at least half of them do: what they lack is a better place, and the same features find it sooner there. The
        stronger frontend is closed with this one.
        """
        return self.fallback if 2 * usable < views else None

    def close(self) -> None:
        for part in (self.process, self.fallback):
            if part is not None:
                part.close()

    def __enter__(self) -> Frontend:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def make_frontend(choice: FeatureChoice) -> Frontend:
    """The frontend that `choice` names; no process starts before its first image. Raises FeatureError as `check_choice`."""
    check_choice(choice)
    if choice.features != AUTO:
        plain = _frontend(choice.features, choice)
        turns = EXTRACTORS[choice.features].needs_model and not MATCHERS[choice.matcher].needs_model
        return replace(plain, fallback=_wide(plain)) if turns else plain
    return replace(_frontend(FIRST, choice), fallback=_wide(_frontend(STRONGER, choice)) if choice.model else None)


def check_choice(choice: FeatureChoice) -> None:
    """Raises FeatureError, with what to do, when the choice names something unknown, unavailable or without its model file, or
    a model file that would be of no use.
    """
    name = STRONGER if choice.features == AUTO and choice.model else FIRST if choice.features == AUTO else choice.features
    extractor = _look_up(EXTRACTORS, name, "features")
    matcher = _look_up(MATCHERS, choice.matcher, "matcher")
    _check_kind(extractor, choice.model)
    _check_kind(matcher, choice.matcher_model)
    if matcher.needs_model and (extractor.binary or choice.features == AUTO):
        raise FeatureError(
            f"The matcher {matcher.title} knows one kind of learned features, not '{choice.features}'; "
            "choose the features that it was trained on, or the matcher 'nearest'."
        )


def _wide(frontend: Frontend) -> Frontend:
    """`frontend` for pairs far apart: the photo in several looks, and the stricter matches that so many of them need."""
    return replace(frontend, photo_extractor=Looks(frontend.extractor), matcher=MutualNearest(WIDE_RATIO))


def _look_up(table: Mapping[str, Kind], name: str, what: str) -> Kind:
    if name not in table:
        raise FeatureError(f"There is no {what} '{name}'; choose one of {', '.join(table)}.")
    return table[name]


def _check_kind(kind: ExtractorKind | MatcherKind, model: str) -> None:
    reason = missing(kind)
    if reason:
        raise FeatureError(f"{kind.title} cannot be used: {reason}; choose other features.")
    if model and not kind.needs_model:
        others = "features" if isinstance(kind, ExtractorKind) else "a matcher"
        raise FeatureError(
            f"{kind.title} needs no model file, and '{Path(model).name}' is given; choose {others} of that model, or leave it "
            "out."
        )
    if kind.needs_model and not model:
        raise FeatureError(f"{kind.title} needs a model file (.onnx) and none is given; name one, or choose features without.")
    if kind.needs_model and not Path(model).is_file():
        raise FeatureError(f"There is no model file at '{model}'; check the path, or choose features that need none.")


def _frontend(name: str, choice: FeatureChoice) -> Frontend:
    kind, matcher_kind = EXTRACTORS[name], MATCHERS[choice.matcher]
    process = None
    if kind.needs_model or matcher_kind.needs_model:
        extractor_net = (name, choice.model) if kind.needs_model else ("", "")
        matcher_net = (choice.matcher, choice.matcher_model) if matcher_kind.needs_model else ("", "")
        process = NetProcess(Nets(*extractor_net, *matcher_net, choice.threads))
    extractor: Extractor = kind.make(NO_PATH)
    matcher: Matcher = MutualNearest(kind.ratio)
    if process is not None and kind.needs_model:
        extractor = RemoteExtractor(process, Path(choice.model).name)
    if process is not None and matcher_kind.needs_model:
        matcher = RemoteMatcher(process, Path(choice.matcher_model).name)
    return Frontend(extractor, matcher, process=process)
