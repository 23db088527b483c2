"""Where the photos of a camera file lie: beside it, or in a folder named images near it, under however spelt a name."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

# Relative to the camera file, where COLMAP, nerfstudio and others usually put them.
PHOTO_PLACES = (".", "images", "../images", "../../images", "../../../images")
# Of several files with one name that differ in this alone, the first is taken.
SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".avif", ".heic", ".heif", ".exr", ".bmp", ".dng")


class PhotoFinder:
    """Finds photo files by the names that a camera file gives them."""

    def __init__(self, camera_file: Path, photos: Path | None = None) -> None:
        """`photos`: the folder that holds them, where it is known."""
        folder = camera_file if camera_file.is_dir() else camera_file.parent
        self._places: Sequence[Path] = [photos] if photos else [folder / place for place in PHOTO_PLACES]
        self._listed: dict[Path, dict[str, Path]] = {}

    def find(self, name: str) -> Path | None:
        """The file of a photo. Its name is tried as it stands and without its folders; then with other letters' case, another
        composition of its accents, or another or no suffix. None where there is none.
        """
        plain = name.replace("\\", "/").strip()
        if not plain:
            return None
        short = plain.rsplit("/", 1)[-1]
        for spelt in dict.fromkeys((plain, short)):
            tries = [place / spelt for place in self._places]
            exact = next((file for file in tries if file.is_file()), None)
            found = exact or next((file for file in map(self._alike, tries) if file is not None), None)
            if found is not None:
                return found
        return None

    def _alike(self, file: Path) -> Path | None:
        """A file in the same folder whose name differs from that of `file` in spelling alone."""
        known = self._list(file.parent)
        stem, suffix = _parts(file.name)
        if f"{stem}{suffix}" in known:
            return known[f"{stem}{suffix}"]
        stems = (stem, f"{stem}{suffix}")
        return next((known[one + other] for one in stems for other in SUFFIXES if one + other in known), None)

    def _list(self, folder: Path) -> dict[str, Path]:
        if folder not in self._listed:
            try:
                files = sorted(path for path in folder.iterdir() if _parts(path.name)[1] in SUFFIXES)
            except OSError:
                files = []
            self._listed[folder] = {"".join(_parts(path.name)): path for path in reversed(files)}
        return self._listed[folder]


def _parts(name: str) -> tuple[str, str]:
    """Stem and suffix, composed and in small letters; a suffix that is none of a picture belongs to the stem."""
    spelt = unicodedata.normalize("NFC", name).casefold()
    suffix = PurePosixPath(spelt).suffix
    return (spelt.removesuffix(suffix), suffix) if suffix in SUFFIXES else (spelt, "")
