"""Where the photos of a camera file lie: beside it, or in a folder named images near it, under however spelt a name."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from ..support.picture_names import PICTURES, file_name, parts_of, spelt, spelt_parts

# Relative to the camera file, where COLMAP, nerfstudio and others usually put them.
PHOTO_PLACES = (".", "images", "../images", "../../images", "../../../images")
UP = ".."


class PhotoFinder:
    """Finds photo files by the names that a camera file gives them."""

    def __init__(self, camera_file: Path, photos: Path | None = None) -> None:
        """`photos`: the folder that holds them, where it is known."""
        folder = camera_file if camera_file.is_dir() else camera_file.parent
        self._places: Sequence[Path] = [photos] if photos else [folder / place for place in PHOTO_PLACES]
        # Whole trees are looked through only where photos are said to lie, for the camera file may lie anywhere.
        self._trees = [photos] if photos else [place for place in self._places if place.name == "images"]
        self._listed: dict[Path, dict[str, Path]] = {}
        self._folders: dict[Path, dict[str, Path]] = {}
        self._below: dict[str, list[Path]] | None = None

    def find(self, name: str) -> Path | None:
        """The file of a photo. Its name is tried as it stands and without its folders; then with other letters' case, another
        composition of its accents, or another or no suffix; then below the folders of photos, where only one file has that
        name. None where there is none.
        """
        plain = name.replace("\\", "/").strip()
        if not plain:
            return None
        for known in dict.fromkeys((plain, file_name(plain))):
            tries = (place / known for place in self._places)
            exact = next((file for file in tries if file.is_file()), None)
            alike = (self.alike(place, parts_of(known)) for place in self._places)
            found = exact or next((file for file in alike if file is not None), None)
            if found is not None:
                return found
        return self._below_the_places(plain)

    def alike(self, place: Path, parts: Sequence[str]) -> Path | None:
        """A file whose path below `place` differs from `parts` in spelling alone."""
        folder: Path | None = place
        for part in parts[:-1]:
            folder = None if folder is None else self._folder(folder, part)
        if folder is None or not parts:
            return None
        known = self._list(folder)
        stem, suffix = spelt_parts(parts[-1])
        if f"{stem}{suffix}" in known:
            return known[f"{stem}{suffix}"]
        stems = (stem, f"{stem}{suffix}")
        return next((known[one + other] for one in stems for other in PICTURES if one + other in known), None)

    def _folder(self, parent: Path, name: str) -> Path | None:
        """The folder of that name in `parent`, however it is spelt."""
        if name == UP or (parent / name).is_dir():
            return parent / name
        if parent not in self._folders:
            found = [entry for entry in _entries(parent) if entry.is_dir()]
            self._folders[parent] = {spelt(path.name): path for path in reversed(found)}
        return self._folders[parent].get(spelt(name))

    def _list(self, folder: Path) -> dict[str, Path]:
        if folder not in self._listed:
            files = [path for path in _entries(folder) if spelt_parts(path.name)[1]]
            self._listed[folder] = {spelt(path.name): path for path in reversed(files)}
        return self._listed[folder]

    def _below_the_places(self, name: str) -> Path | None:
        if self._below is None:
            self._below = defaultdict(list)
            for tree in self._trees:
                for folder, _, files in os.walk(tree):
                    for file in files:
                        stem, suffix = spelt_parts(file)
                        if suffix:
                            self._below[stem].append(Path(folder, file))
        stem, suffix = spelt_parts(file_name(name))
        found = self._below.get(stem, [])
        same = [path for path in found if spelt_parts(path.name)[1] == suffix] or found
        return same[0] if len(same) == 1 else None


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []
