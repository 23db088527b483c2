"""Making a proxy beside Blender: prepare, watch."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence

import bpy

from ...core.errors import ProxyError
from ...core.geometry.camera import Camera
from ...core.proxy import ProxyMesh, ProxySettings, ProxyStep, iterate_proxy
from ...core.render import memory
from ..jobs.machine import Job
from ..registration import preferences
from ..splat import object as splat_object
from ..splat.copy import SplatCopying
from ..support.session_ids import by_uid
from ..support.texts import iface_, n_, rpt_

LEAST_FRACTION = 0.1  # from which on the time left is told


class ProxyJob(Job):
    """Its result is the ProxyMesh, in the splat object's coordinates."""

    status = n_("Making the proxy    Esc: cancel")
    doubts = ""  # of its cameras, to be said at the end

    def __init__(
        self, scene: bpy.types.Scene, splat: bpy.types.Object, cameras: Sequence[Camera], settings: ProxySettings
    ) -> None:
        """Raises GssmcError when the object is no splat, or it would take more memory than is allowed."""
        copying = SplatCopying(splat)
        pixels = sum(settings.long_side_px**2 for _ in cameras)
        count, coefficients = len(splat.data.points), splat_object.sh_coefficients(splat)
        needed = memory.proxy_bytes(count, coefficients, settings.faces, pixels)
        memory.check("The proxy", needed, preferences.memory_limit(bpy.context))
        super().__init__(self._steps, copying)
        self._splat: SplatCopying | None = copying
        self.cameras, self._settings = cameras, settings
        self._uids = scene.session_uid, splat.session_uid
        self._began = 0.0

    def find(self) -> tuple[bpy.types.Scene, bpy.types.Object]:
        """The live scene and splat. Raises ProxyError when one is gone."""
        scene = by_uid(bpy.data.scenes, self._uids[0])
        splat = by_uid(scene.objects, self._uids[1]) if scene else None
        if splat is None:
            raise ProxyError(rpt_("The splat was removed while its proxy was made; nothing was changed."))
        return scene, splat

    def check(self) -> None:
        self.find()

    def on_progress(self, news: ProxyStep) -> None:
        self.fraction = news.fraction
        step = iface_(news.step)
        self.step = step[:1].upper() + step[1:]
        parts = [iface_("View {number} of {count}", number=news.view, count=news.views)] if news.view else []
        if self.fraction > LEAST_FRACTION:
            seconds = (time.perf_counter() - self._began) * (1 - self.fraction) / self.fraction
            parts.append(iface_("about {seconds:.0f} s to go", seconds=seconds))
        self.detail = ", ".join(parts)

    def _steps(self) -> Generator[ProxyStep, None, ProxyMesh]:
        """The whole work, in the thread; the copy of the splat goes as soon as the engine has it."""
        self._began = time.perf_counter()
        assert self._splat is not None, "the work begins once"
        copy, self._splat = self._splat, None
        return (yield from iterate_proxy(copy.copy().assemble(), self.cameras, self._settings, lambda: self.cancelled))
