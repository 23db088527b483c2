"""What two machines must have alike so that their answers are the same to the last bit."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import scipy

ENGINE = "GS-SMC"
SHOWN = 8  # digits of the engine's digest


def versions() -> dict[str, str]:
    """Name to version, of Python, of the libraries that compute, and of the engine (a digest of its files)."""
    package, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    libraries = {"NumPy": np.__version__, "OpenCV": cv2.__version__, "SciPy": scipy.__version__}
    return {ENGINE: digest.hexdigest()[:SHOWN], "Python": ".".join(platform.python_version_tuple()[:2]), **libraries}


def difference(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """In words what differs, as in "NumPy 2.2 instead of 2.3"; empty where nothing does."""
    found = [f"{name} {there.get(name, 'none')} instead of {own}" for name, own in here.items() if there.get(name) != own]
    return ", ".join(found)
