"""Where this program keeps files that can be made again."""

from __future__ import annotations

import os
import sys
from pathlib import Path

FOLDER = "gssmc"


def user_cache_folder() -> Path:
    """The folder for this program's files that can be made again, by the rules of the system; it need not exist yet."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / FOLDER / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / FOLDER
    given = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(given) if os.path.isabs(given) else Path.home() / ".cache") / FOLDER  # a relative one is to be ignored
