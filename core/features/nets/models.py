"""Network files: the ones we know, as data, how a file is recognised, and where a folder of them is looked through.

No weights come with this project. The .onnx files of this table were converted from the upstream weights by this project and
are published nowhere yet, so no entry has an address: a studio names a base address of its own, or the file is put in by hand.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from ...errors import FeatureError

CHUNK_BYTES = 1 << 20


@dataclass(frozen=True)
class KnownModel:
    """One network file.

    `features`: the registry's name of what it is for. `source`: where the weights come from. `url`: "" where the file has no
    address of its own; then the base address that the user sets is taken, followed by the file's name.
    """

    name: str
    title: str
    features: str
    bytes: int
    sha256: str
    licence: str
    licence_text: str
    source: str
    url: str = ""


ALIKED_LICENCE = (
    "BSD 3-Clause, Copyright (c) 2022 Zhao Xiaoming. You may use and pass on the file, also commercially, as long as this "
    "notice, the conditions and the disclaimer stay with it and the author's name endorses nothing without permission. "
    "It comes as is, without any warranty."
)
ALIKED_SOURCE = "https://github.com/Shiaoming/ALIKED"

KNOWN = (
    KnownModel(
        "aliked-t16-top2048.onnx",
        "ALIKED-T16",
        "aliked",
        800_007,
        "b3baec9eaa94c039c7f837437ff8414f75bbdd172e247a6b606d42634ff9821e",
        "BSD-3-Clause",
        ALIKED_LICENCE,
        ALIKED_SOURCE,
    ),
    KnownModel(
        "aliked-n16rot-top2048.onnx",
        "ALIKED-N16rot",
        "aliked",
        2_740_100,
        "b740bfd367321708ea4959638827586107254f5db6b8a8ae1f174e22584cc8d5",
        "BSD-3-Clause",
        ALIKED_LICENCE,
        ALIKED_SOURCE,
    ),
)


def sha256_of(path: Path) -> str:
    """Hex digest of the file. OSError passes through."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def recognise(path: Path) -> KnownModel | None:
    """The known model that the file is, whatever its name; None for any other file, and for none."""
    try:
        size = path.stat().st_size
        if not any(model.bytes == size for model in KNOWN):
            return None
        digest = sha256_of(path)
    except OSError:
        return None
    return next((model for model in KNOWN if model.sha256 == digest), None)


def find_model(folder: Path, features: str) -> Path | None:
    """The first known model for `features` in `folder`, in the table's order: small ones first. None when there is none."""
    for model in KNOWN:
        path = folder / model.name
        if model.features == features and recognise(path) == model:
            return path
    return None


def address(model: KnownModel, base_url: str) -> str:
    """Where the model is downloaded from. Raises FeatureError when no address is set."""
    if model.url:
        return model.url
    if not base_url.strip():
        raise FeatureError(
            f"No address is set to download {model.title} from; set one in the preferences, "
            f"or put the file '{model.name}' in by hand."
        )
    return base_url.strip().rstrip("/") + "/" + model.name
