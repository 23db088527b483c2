"""The download of a model file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ...core.features.nets.download import DownloadProgress, download
from ...core.features.nets.models import KnownModel
from ..support.texts import iface_, n_
from .machine import Job


class DownloadJob(Job):
    """Fetches `model` from `url` into `folder`. Its result is the file's path.

    A download that was stopped is continued by the next one.
    """

    at_mouse = True

    def __init__(self, model: KnownModel, url: str, folder: Path) -> None:
        super().__init__(partial(download, model, url, folder))
        self.step = n_("Downloading")
        self._title = model.title
        self._say(0.0)

    def on_progress(self, news: DownloadProgress) -> None:
        self.fraction = news.fraction
        self._say(news.fraction)

    def _say(self, fraction: float) -> None:
        values = {"model": self._title, "percent": 100 * fraction}
        self.status = iface_("Downloading {model}: {percent:.0f} %    Esc: stop", **values)
        self.detail = self._title
