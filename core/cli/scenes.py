"""Which files belong to which scene of an evaluation."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..cameras import PoseSet, Split, detect, read
from ..errors import DatasetError

SCENE = "{scene}"


@dataclass(frozen=True)
class Scene:
    """A scene's name and its true poses."""

    name: str
    truth: PoseSet


def find_scenes(truth: Path, split: Split) -> list[Scene]:
    """The scenes at `truth`: one file or folder of poses; a folder of such folders; or a path with {scene} in it.

    Raises DatasetError when there is none.
    """
    if SCENE in str(truth):
        found = _by_pattern(str(truth))
        if not found:
            raise DatasetError(f"No file is of the form '{truth}'; check the path.")
        return [Scene(name, read(path, split)) for name, path in found.items()]
    if not truth.is_dir() or detect(truth):
        return [Scene(_title(truth), read(truth, split))]
    folders = [folder for folder in sorted(truth.iterdir()) if folder.is_dir() and not folder.name.startswith(".")]
    found = {folder.name: path for folder in folders if (path := _poses_in(folder)) is not None}
    if not found:
        # The error that it raises says what such a folder should hold.
        read(truth, split)
    return [Scene(name, read(path, split)) for name, path in found.items()]


def poses_of(path: Path, scenes: list[Scene], split: Split) -> Callable[[Scene], PoseSet]:
    """How to get the poses that `path` holds for one of the scenes; read once where one file serves them all.

    `path` may hold {scene}; be a folder with a file or folder for each scene; or be one file, in which names begin with their
    scene's folder where there are several scenes.
    """
    if SCENE in str(path):
        return lambda scene: read(Path(str(path).replace(SCENE, scene.name)), split)
    if len(scenes) == 1:
        poses = read(path, split)
        return lambda scene: poses
    if path.is_dir() and not detect(path):
        return lambda scene: read(_file_of(path, scene), split)
    together = read(path, split)
    return lambda scene: _share(together, scene)


def _title(path: Path) -> str:
    """A folder's name; a file's with its folder, for files are named alike in the folders of several scenes."""
    whole = path.resolve()
    return f"{whole.parent.name}/{whole.name}" if whole.is_file() else whole.name


def _by_pattern(pattern: str) -> dict[str, Path]:
    """Scene name to path, of the paths that a pattern with {scene} fits."""
    pieces = [re.escape(piece) for piece in pattern.split(SCENE)]
    form = re.compile(pieces[0] + r"([^/\\]+)" + r"\1".join(pieces[1:]))
    paths = sorted(glob.glob("*".join(glob.escape(piece) for piece in pattern.split(SCENE))))
    return {match[1]: Path(path) for path in paths if (match := form.fullmatch(path))}


def _poses_in(folder: Path) -> Path | None:
    """The poses of a scene's folder: itself, or the only file of poses in it."""
    if detect(folder):
        return folder
    files = [file for file in sorted(folder.iterdir()) if file.suffix in (".txt", ".json")]
    if len(files) > 1:
        raise DatasetError(f"'{folder}' holds several files; say which, as in .../{SCENE}/{files[0].name}.")
    return files[0] if files else None


def _file_of(folder: Path, scene: Scene) -> Path:
    for name in (scene.name, f"{scene.name}.json", f"{scene.name}.txt"):
        path = folder / name
        if path.exists():
            inner = _poses_in(path) if path.is_dir() else path
            if inner is not None:
                return inner
    raise DatasetError(f"'{folder}' holds no poses of the scene '{scene.name}'; put '{scene.name}.txt' or '.json' there.")


def _share(together: PoseSet, scene: Scene) -> PoseSet:
    """The frames whose names begin with the scene's folder."""
    own = [(frame, _below(frame.name, scene.name)) for frame in together.frames]
    frames = tuple(replace(frame, name=rest) for frame, rest in own if rest)
    if not frames:
        raise DatasetError(
            f"No name of '{together.source}' begins with '{scene.name}/'; with several scenes, give names with their scene, "
            f"or a file for each scene with {SCENE} in its path."
        )
    return replace(together, frames=frames, unsolved=0)


def _below(name: str, scene: str) -> str:
    """The name inside the scene's folder; empty when it lies elsewhere."""
    parts = name.replace("\\", "/").split("/")
    return "/".join(parts[parts.index(scene) + 1 :]) if scene in parts[:-1] else ""
