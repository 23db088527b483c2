"""A splat object copied out of Blender's memory, for work in other threads: at once, or in steps beside the user's own work."""

from __future__ import annotations

import threading
import time
import zlib
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.errors import SplatFormatError
from ...core.splats.scene import GaussianScene
from ..support.texts import n_, rpt_
from .object import ANTIALIASED, BASE, SH_PREFIX, check_attribute, check_splat, read_attribute, sh_bands

SHAPE = (("position", 3), ("scale", 3), ("rotation", 4), (BASE, 4))  # before the SH coefficients


@dataclass(frozen=True, eq=False)
class SplatCopy:
    """A splat object's attributes as Blender holds them, copied: means (N, 3), scales (N, 3), rotations (N, 4), base (N, 4)
    with f_dc and opacity, and one (N, 3) array per SH coefficient above degree 0; all float32.
    """

    means: np.ndarray
    scales: np.ndarray
    rotations: np.ndarray
    base: np.ndarray
    bands: tuple[np.ndarray, ...]
    antialiased: bool = False

    def assemble(self) -> GaussianScene:
        """The engine's scene. Needs no Blender and takes a while on large scans, hence fit for a worker thread.

        Editing tools and other importers leave NaN, quaternions of any length and negative scales behind, hence it is checked
        as a file is, in the copy's own arrays. Raises SplatFormatError when nothing is left.
        """
        sh = np.empty((len(self.means), 1 + len(self.bands), 3), np.float32)
        sh[:, 0] = self.base[:, :3]
        for k, band in enumerate(self.bands):
            sh[:, k + 1] = band
        opacities = self.base[:, 3].copy()
        try:
            arrays = (self.means, self.scales, self.rotations, opacities, sh)
            return GaussianScene(*arrays, format="Blender point cloud", antialiased=self.antialiased).checked()
        except SplatFormatError:
            raise SplatFormatError(
                n_("Every Gaussian of the splat object holds a value that is not finite; import the file again.")
            ) from None


class SplatCopying:
    """A copy in the making. Beside the user's own work `start()`, then `advance()` until it says True; or `finish()` at once.

    Between two calls the user may do anything. All that was copied is compared with Blender's memory a second time, so that
    what comes out was there as a whole, at one moment. Most of the time goes into memory that the system has to find: that
    is left to a thread, and copying into it is quick. All methods belong to the main thread, `copy()` to any.
    """

    def __init__(self, obj: bpy.types.Object) -> None:
        """Raises SplatFormatError when the object is no splat, or an empty one."""
        check_splat(obj)
        self._count = len(obj.data.points)
        if self._count == 0:
            raise SplatFormatError(rpt_('"{name}" has no points; import the splat file again.', name=obj.name))
        self._wanted = [*SHAPE, *((f"{SH_PREFIX}{k}", 3) for k in range(sh_bands(obj.data)))]
        for name, components in self._wanted:
            check_attribute(obj.data, name, components)
        self._antialiased = bool(obj.data.get(ANTIALIASED))
        self._name, self._uids = obj.name, (obj.session_uid, obj.data.session_uid)
        self._room: list[np.ndarray] = []  # One array per attribute and one to compare with; the thread adds them.
        self._copied = self._compared = 0
        self._stopped, self._no_room = threading.Event(), threading.Event()

    @property
    def fraction(self) -> float:
        """The share 0..1 that is done: each attribute is copied, and then compared."""
        return (self._copied + self._compared) / (2 * len(self._wanted))

    def start(self) -> None:
        """Begins to make room for the copy, in a thread that touches no Blender data."""
        threading.Thread(target=self._make_room, name="gssmc-copy", daemon=True).start()

    def stop(self) -> None:
        """Ends the thread soon; harmless when it has ended, or never began."""
        self._stopped.set()

    def advance(self, until: float) -> bool:
        """Goes on until time.perf_counter() is past `until`, one attribute at least; True when the copy is complete.

        Raises SplatFormatError when the object was removed or edited since the beginning, or does not fit into memory.
        """
        cloud = self._cloud()
        while self._compared < len(self._wanted):
            self._check_room()
            if self._copied < len(self._wanted):
                if self._copied == len(self._room):
                    return False
                self._read(cloud, self._copied, self._room[self._copied])
                self._copied += 1
            elif len(self._room) > len(self._wanted):
                self._compare(cloud)
            else:
                return False
            if time.perf_counter() > until:
                break
        return self._compared == len(self._wanted)

    def finish(self) -> SplatCopying:
        """All in one go, in which nobody can come between. Raises SplatFormatError when it does not fit into memory."""
        cloud = self._cloud()
        self._make_room(compare=False)
        self._check_room()
        for index in range(len(self._wanted)):
            self._read(cloud, index, self._room[index])
        self._copied = self._compared = len(self._wanted)
        return self

    def copy(self) -> SplatCopy:
        """What was copied, once it is complete; the memory is the copy's from here on."""
        pairs = zip(self._room, self._wanted, strict=False)
        arrays = [array.reshape(self._count, components) for array, (_, components) in pairs]
        self._room = []
        means, scales, rotations, base, *bands = arrays
        return SplatCopy(means, scales, rotations, base, tuple(bands), self._antialiased)

    def _make_room(self, compare: bool = True) -> None:
        try:
            for components in [*(components for _, components in self._wanted), *([4] if compare else [])]:
                if self._stopped.is_set():
                    return
                array = np.empty(self._count * components, np.float32)
                array.fill(0.0)  # Writing makes the system really provide the memory.
                self._room.append(array)
        except MemoryError:
            self._no_room.set()

    def _check_room(self) -> None:
        if self._no_room.is_set():
            raise SplatFormatError(rpt_("There is not enough memory for this splat; close other files or use a smaller scan."))

    def _compare(self, cloud: bpy.types.PointCloud) -> None:
        copied, again = self._room[self._compared], self._room[-1]
        again = again[: len(copied)]
        self._read(cloud, self._compared, again)
        if not np.array_equal(copied.view(np.uint32), again.view(np.uint32)):  # bits: NaN is equal to itself
            raise self._edited()
        self._compared += 1

    def _read(self, cloud: bpy.types.PointCloud, index: int, into: np.ndarray) -> None:
        try:
            read_attribute(cloud, *self._wanted[index], into)
        except (KeyError, SplatFormatError) as error:
            raise self._edited() from error

    def _cloud(self) -> bpy.types.PointCloud:
        obj = next((obj for obj in bpy.data.objects if obj.session_uid == self._uids[0]), None)
        if obj is None:
            raise SplatFormatError(
                rpt_('The splat "{name}" was removed while it was copied; nothing was changed.', name=self._name)
            )
        if obj.data.session_uid != self._uids[1] or len(obj.data.points) != self._count:
            raise self._edited()
        return obj.data

    def _edited(self) -> SplatFormatError:
        return SplatFormatError(
            rpt_('The splat "{name}" was edited while it was copied; nothing was changed, start again.', name=self._name)
        )


def digest(cloud: bpy.types.PointCloud) -> int:
    """A checksum of all that a copy would hold. Raises SplatFormatError or KeyError when the cloud holds no splat."""
    checksum = 0
    for name, components in [*SHAPE, *((f"{SH_PREFIX}{k}", 3) for k in range(sh_bands(cloud)))]:
        checksum = zlib.crc32(read_attribute(cloud, name, components), checksum)
    return checksum


def read_splat(obj: bpy.types.Object) -> GaussianScene:
    """The Gaussians of a splat object. Raises SplatFormatError when it is no splat."""
    return SplatCopying(obj).finish().copy().assemble()
