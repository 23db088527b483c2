"""Fetches one known file: taken up again where it broke off, checked by size and sha256, and there only when it is whole.

Nothing here asks whether the network may be used; whoever calls it has (in Blender: `bpy.app.online_access`).
"""

from __future__ import annotations

import http.client
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from ...errors import GssmcError
from .models import KnownModel, sha256_of

CHUNK_BYTES = 1 << 16
TIMEOUT_S = 20.0
SCHEMES = ("http", "https")
PARTIAL_CONTENT, RANGE_NOT_SATISFIABLE = 206, 416


class DownloadError(GssmcError):
    """A file could not be fetched; what came of it so far is kept for the next try unless it is wrong."""


@dataclass(frozen=True)
class DownloadProgress:
    """Bytes there, and bytes in all."""

    done: int
    total: int

    @property
    def fraction(self) -> float:
        return self.done / self.total


Steps = Generator[DownloadProgress, None, Path]


def download(model: KnownModel, url: str, folder: Path, opener: Callable[[Path, str], IO[bytes]] | None = None) -> Steps:
    """Fetches `model` from `url` into `folder` under its own name: yields progress, returns the path.

    A file that is there already and right is not fetched. Closing the generator cancels; the part that came stays beside the
    target as NAME.part and the next call goes on from it. `opener` opens the part for writing (tests). Raises DownloadError.
    """
    if urllib.parse.urlsplit(url).scheme not in SCHEMES:
        raise DownloadError(f"'{url}' is no web address; it must begin with http:// or https://.")
    target, part = folder / model.name, folder / f"{model.name}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if target.is_file() and sha256_of(target) == model.sha256:
            yield DownloadProgress(model.bytes, model.bytes)
            return target
        yield from _fetch(model, url, part, opener or _open)
        if sha256_of(part) != model.sha256:
            raise _wrong(model, part)
        os.replace(part, target)
    except OSError as error:
        raise DownloadError(
            f"'{model.name}' cannot be written to '{folder}' ({error.strerror or error}); make room there and download again."
        ) from error
    return target


def _open(path: Path, mode: str) -> IO[Any]:
    return path.open(mode)


def _fetch(
    model: KnownModel, url: str, part: Path, opener: Callable[[Path, str], IO[bytes]]
) -> Generator[DownloadProgress, None, None]:
    """Completes `part`. OSError is one of writing; those of the network become DownloadError."""
    have = part.stat().st_size if part.is_file() else 0
    if have > model.bytes:
        have = 0
    yield DownloadProgress(have, model.bytes)
    if have == model.bytes:
        return
    with _request(model, url, have) as answer:
        if have and answer.status != PARTIAL_CONTENT:
            have = 0  # the server does not do parts and sends the whole
        with opener(part, "ab" if have else "wb") as file:
            while have < model.bytes:
                chunk = _read(answer)
                if not chunk:
                    raise DownloadError(
                        f"The connection broke off after {have} of {model.bytes} bytes of '{model.name}'; download again, "
                        "it goes on from there."
                    )
                if have + len(chunk) > model.bytes:
                    raise _wrong(model, part)
                file.write(chunk)
                have += len(chunk)
                yield DownloadProgress(have, model.bytes)


def _request(model: KnownModel, url: str, have: int) -> http.client.HTTPResponse:
    """The open answer, from byte `have` on where the server can."""
    request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})
    try:
        answer: http.client.HTTPResponse = urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == RANGE_NOT_SATISFIABLE and have:
            return _request(model, url, 0)
        raise DownloadError(f"The server answers {error.code} to '{url}'; check the address in the preferences.") from None
    except (OSError, http.client.HTTPException, ValueError) as error:
        reason = getattr(error, "reason", error)
        raise DownloadError(
            f"'{url}' cannot be reached ({reason}); check the address in the preferences and the connection."
        ) from None
    start = (answer.headers.get("Content-Range") or "").removeprefix("bytes ").split("-")[0]
    if answer.status == PARTIAL_CONTENT and start != str(have):
        answer.close()
        raise DownloadError(f"The server of '{url}' sent another part than was asked for; download again.")
    return answer


def _read(answer: http.client.HTTPResponse) -> bytes:
    """The next bytes; none at the end, and none when the connection broke off."""
    try:
        return answer.read1(CHUNK_BYTES)
    except (OSError, http.client.HTTPException):
        return b""


def _wrong(model: KnownModel, part: Path) -> DownloadError:
    """The error for a file that is another one; what came of it is worth nothing and goes."""
    part.unlink(missing_ok=True)
    return DownloadError(
        f"What came is not '{model.name}' (its sha256 is another), and was thrown away; check the address in the preferences."
    )
