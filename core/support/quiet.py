"""OpenCV kept from writing to the user's terminal: what a damaged file means is said in a sentence of our own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

# FFmpeg's own level, which OpenCV reads when it opens its first movie.
MOVIE_LEVEL, NOTHING = "OPENCV_FFMPEG_LOGLEVEL", "-8"


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Within it OpenCV logs nothing; its level is put back at the end."""
    os.environ.setdefault(MOVIE_LEVEL, NOTHING)
    logging = cv2.utils.logging
    level = logging.getLogLevel()
    logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        logging.setLogLevel(level)
