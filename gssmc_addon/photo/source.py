"""Where a job finds a photo's pixels: the contract that an image, a frame of a plate and a masked photo share."""

from __future__ import annotations

from typing import Protocol

from ...core.photos.photo import Photo


class PhotoSource(Protocol):
    """A photo that was copied out of Blender, and is decoded later.

    `name` is for messages, `path` names the file. `read` needs no Blender, hence is fit for a worker thread; it raises
    PhotoError when the photo cannot be decoded.
    """

    @property
    def name(self) -> str: ...

    @property
    def path(self) -> str: ...

    def read(self) -> Photo: ...
