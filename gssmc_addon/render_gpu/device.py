"""The end of everything on the graphics card, when the extension is switched off."""

from __future__ import annotations

from . import choice
from .executor import executor


def unregister() -> None:
    """Ends what still asks for views, and frees shaders and textures. Main thread."""
    executor.close()
    choice.forget()
