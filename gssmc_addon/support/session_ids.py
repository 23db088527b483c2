"""Blender's data-blocks by their session id, which stays valid where a reference does not: over undo, renaming and deletion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def by_uid(blocks: Iterable[Any], uid: int) -> Any:
    """The block of `blocks` with the session id `uid`; None when there is none any more."""
    return next((block for block in blocks if block.session_uid == uid), None)
