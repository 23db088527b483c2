"""Where a photo lies in a region of the viewport that looks through its camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.geometry.camera import Intrinsics
from ..camera import bridge as camera_bridge
from ..photo import image as photo_image
from ..viewport.front import border_of


@dataclass(frozen=True)
class PhotoOnScreen:
    """A photo of `size` (width, height) pixels between `low` and `high`, its lower left and upper right corner in pixels of the
    region, which are counted from below. `bent`: the photo's lens, where its undistorted copy is shown; None where itself is.
    """

    size: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]
    bent: Intrinsics | None = None

    @classmethod
    def fitted(cls, size: tuple[int, int], pixel: float, border: np.ndarray, region: tuple[int, int]) -> PhotoOnScreen:
        """The photo, its pixels `pixel` times as wide as high, as large as fits into the middle of the camera's frame, whose
        corners `border` (2, 2) are given in 0..1 of the `region` (width, height).
        """
        low, high = border[0] * region, border[1] * region
        middle, half = (low + high) / 2, (high - low) / 2
        wider = size[0] * pixel / size[1] * half[1] / half[0]  # than the frame
        half = half * (min(1.0, wider), min(1.0, 1 / wider))
        a, b = (middle - half).tolist(), (middle + half).tolist()
        return cls(size, (a[0], a[1]), (b[0], b[1]))

    @classmethod
    def of(
        cls, scene: bpy.types.Scene, camera: bpy.types.Object, region: bpy.types.Region, view: bpy.types.RegionView3D
    ) -> PhotoOnScreen | None:
        """The camera's photo, drawn straight; None where the view does not look through a camera, or there is no photo."""
        size = photo_image.own_size(camera.data)
        if view.view_perspective != "CAMERA" or not all(size):
            return None
        frame = border_of(scene, camera.data, view.window_matrix)
        # A frame that shows more than the photo has it smaller in its middle.
        border = frame.mean(axis=0) + (frame - frame.mean(axis=0)) / camera.data.gssmc.overscan
        pixel = camera_bridge.photo_pixel(camera.data, camera_bridge.read_lens(scene, camera.data))
        photo = cls.fitted(size, pixel, border, (region.width, region.height))
        copy = camera.data.gssmc.undistorted
        if copy is None or not any(b.image == copy and b.show_background_image for b in camera.data.background_images):
            return photo
        return replace(photo, bent=camera_bridge.photo_intrinsics(scene, camera.data, *size))

    def to_region(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """The place in the region of a pixel of the photo, which are counted from above."""
        (x0, y0), (x1, y1), (width, height) = self.low, self.high, self.size
        if self.bent is not None:
            pixel = tuple(self.bent.undistort([pixel])[0].tolist())
        return x0 + pixel[0] / width * (x1 - x0), y1 - pixel[1] / height * (y1 - y0)

    def to_photo(self, place: tuple[float, float]) -> tuple[float, float]:
        """The pixel of the photo at a place in the region."""
        (x0, y0), (x1, y1), (width, height) = self.low, self.high, self.size
        x, y = (place[0] - x0) / (x1 - x0) * width, (y1 - place[1]) / (y1 - y0) * height
        if self.bent is not None:
            ideal = self.bent.pinhole().normalise([(x, y)])
            x, y = self.bent.to_pixels(self.bent.distort_normalised(ideal))[0].tolist()
        return x, y
