"""The log file that the preferences name: what the engine logs, for reports of problems."""

from __future__ import annotations

import logging

import bpy

from .texts import rpt_

ROOT = __package__.rsplit(".", 2)[0]  # the extension's own package: engine, add-on and operators log below it
FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
_handlers: list[logging.FileHandler] = []


def set_file(path: str) -> str:
    """Logs to `path` from now on, "" for nowhere. What is wrong with it, as a sentence; "" when it works."""
    stop()
    if not path:
        return ""
    try:
        handler = logging.FileHandler(bpy.path.abspath(path), encoding="utf-8")
    except OSError as error:
        return rpt_("The log file cannot be written ({reason}); choose another place.", reason=error.strerror)
    handler.setFormatter(logging.Formatter(FORMAT))
    logger = logging.getLogger(ROOT)
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    _handlers.append(handler)
    return ""


def stop() -> None:
    """Closes the file."""
    logger = logging.getLogger(ROOT)
    while _handlers:
        handler = _handlers.pop()
        logger.removeHandler(handler)
        handler.close()
        logger.setLevel(logging.NOTSET)
