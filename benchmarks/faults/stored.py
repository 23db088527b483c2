"""Damaged bytes in what commands store and read again, by the hundred: read in this process, which takes milliseconds."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from commands import COMMANDS
from damage import damaged
from samples import MAP, SCAN, VIEWS, Samples
from trial import Faulted

from core.batch.keys import key_of
from core.batch.store import ResultsError, ResultStore
from core.cli.plates.several import finished
from core.locate import LandmarkMap, MapCache, MapPlace, MapSettings
from core.splats import read_splats
from core.support.arrays_file import read_arrays
from core.track import PartialTrack
from core.track.journal import read_found, write_found

Read = Callable[[Path], list[str]]
KEYS = [key_of("photo", number) for number in range(6)]


def record(number: int) -> dict[str, Any]:
    rng = np.random.default_rng(number)
    pose = {"R": rng.normal(size=(3, 3)).tolist(), "t": rng.normal(size=3).tolist()}
    return {"file": f"photo_{number}.png", **pose, "verdict": "trusted", "reasons": ["Held by 7 views."], "seconds": 1.5}


def _plain(answer: dict[str, Any]) -> dict[str, Any]:
    return {name: answer.get(name) for name in record(0)}


def batch_file(folder: Path, name: str) -> tuple[Path, Read]:
    """A whole results file, or the journal of a batch that was killed, of the same six photos."""
    path = folder / "r.json"
    store = ResultStore(path, KEYS)
    store.__enter__()
    for number in range(len(KEYS)):
        store.put(number, record(number))
    if name == "r.json":
        store.__exit__(None, None, None)
    else:
        os.close(store._handle)

    def read(file: Path) -> list[str]:
        try:
            with ResultStore(path, KEYS) as again:
                wrong = [f"record {n}" for n, one in again.records.items() if _plain(one) != record(n)]
                for number in range(len(KEYS)):
                    if number not in again.records:
                        again.put(number, record(number))
        except ResultsError:
            return []  # refused in a sentence, and nothing was touched
        frames = json.loads(path.read_text())["frames"]
        return wrong + [f"record {n} afterwards" for n, one in enumerate(frames) if _plain(one) != record(n)]

    return folder / name, read


def map_file(folder: Path, samples: Samples) -> tuple[Path, Read]:
    shutil.copy(samples.folder / MAP, folder / MAP)
    scene = read_splats(samples.folder / SCAN)
    cache = MapCache(scene, MapPlace(folder / SCAN), MapSettings(VIEWS))
    good = cache.read()
    assert len(good)

    def read(file: Path) -> list[str]:
        found = cache.read()
        wrong = [] if len(found) == 0 or _same_map(found, good) else ["another map"]
        assert cache.keep(good) == file and _same_map(cache.read(), good), "a good map was not stored again"
        return wrong

    return folder / MAP, read


def _same_map(a: LandmarkMap, b: LandmarkMap) -> bool:
    views = zip(a.views, b.views, strict=False)
    same = all((x.points == y.points).all() and (x.descriptors == y.descriptors).all() and x.depth == y.depth for x, y in views)
    return same and (len(a), a.complete) == (len(b), b.complete)


def track_journal(folder: Path, found: Path, key: str) -> tuple[Path, Read]:
    """`found`: the journal of a track that was interrupted."""
    journal = folder / "t.json.journal"
    shutil.copy(found, journal)
    good = read_found(journal, key)
    assert good.ties

    def read(file: Path) -> list[str]:
        again = read_found(journal, key)
        wrong = [] if not again.ties or _same_track(again, good) else ["another track"]
        write_found(journal, good, key)
        assert _same_track(read_found(journal, key), good)
        return wrong

    return journal, read


def _same_track(a: PartialTrack, b: PartialTrack) -> bool:
    return list(a.ties) == list(b.ties) and all(
        (a.ties[f].pose.R == b.ties[f].pose.R).all()
        and (a.ties[f].pose.t == b.ties[f].pose.t).all()
        and (a.ties[f].evidence.equations.information == b.ties[f].evidence.equations.information).all()
        and (a.ties[f].evidence.pixels.gradient == b.ties[f].evidence.pixels.gradient).all()
        for f in a.ties
    )


def track_file(folder: Path, whole: Path) -> tuple[Path, Read]:
    """`whole`: TRACK.json of a track, which the same command for several plates takes for finished."""
    path = folder / "t.json"
    shutil.copy(whole, path)
    data = json.loads(path.read_text())
    good = finished(path, data["key"])
    assert good is not None

    def read(file: Path) -> list[str]:
        again = finished(path, data["key"])
        return [] if again is None or _numbers(again) == _numbers(good) else ["another track"]

    return path, read


def _numbers(track: Any) -> list[Any]:
    frames = [(f.frame, f.state, f.camera.pose.R.tolist(), f.camera.pose.t.tolist(), f.camera.intrinsics) for f in track.frames]
    return [track.verdict, track.readout, frames]


def run(make: Callable[[Path], tuple[Path, Read]], folder: Path, seed: int, count: int) -> Iterator[list[str]]:
    """Per trial, what was wrong."""
    for number in range(count):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        file, read = make(folder)
        file.write_bytes(damaged(file.read_bytes(), np.random.default_rng([seed, number])))
        try:
            yield read(file)
        except Exception as error:  # noqa: BLE001 - whatever goes through is what is looked for
            yield [f"{type(error).__name__}: {str(error)[:200]}"]


def whole_track(folder: Path, samples: Samples) -> Path:
    """TRACK.json of the samples' plate, made where it is not there yet."""
    trial = _tracked(folder / "whole", samples, interrupt=False)
    return trial / "out" / "r.json"


def interrupted_track(folder: Path, samples: Samples) -> tuple[Path, str]:
    """The journal of a track that was interrupted, with its key; made where it is not there yet."""
    journal = _tracked(folder / "interrupted", samples, interrupt=True) / "out" / "r.json.journal"
    return journal, json.loads(read_arrays(journal)["head"].tobytes())["key"]


def _tracked(folder: Path, samples: Samples, interrupt: bool) -> Path:
    if not folder.exists():
        trial = Faulted(COMMANDS["track"], folder, samples, np.random.default_rng(0))
        process = trial.start()
        while interrupt and process.stderr is not None and "frame" not in process.stderr.readline().partition("Tracking")[2]:
            pass
        if interrupt:
            process.send_signal(signal.SIGINT)
        trial.end(process)
    return folder
