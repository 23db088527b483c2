"""The process that runs foreign networks, started by nets/process.py: a graph that kills it costs one request, not Blender.

The first message is {"extractor", "model", "matcher", "matcher_model", "threads"}, answered by {} once the networks are there;
each further one is {"do": "extract"} with a grey image, answered by features, or {"do": "match", "a", "b"} with two sets of
features, answered by matches. What OpenCV refuses is answered by {"error": what it said}. The process ends when its input
does, at once, whatever it is doing.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import cv2
import numpy as np

from ...errors import FeatureError
from ...processes.requests import Message, Requests
from ...processes.wire import WireError
from ..registry import EXTRACTORS, MATCHERS
from ..types import Extractor, Matcher
from .messages import pack_features, unpack_features


def main() -> int:
    """Serve requests from stdin on stdout."""
    requests = Requests()
    first, _ = requests.next()
    cv2.setNumThreads(int(first["threads"]) or os.cpu_count() or 1)
    extractor = EXTRACTORS[first["extractor"]].make(Path(first["model"])) if first["extractor"] else None
    matcher = MATCHERS[first["matcher"]].make(Path(first["matcher_model"])) if first["matcher"] else None
    requests.answer({})
    while True:
        requests.answer(*_answer(requests.next(), extractor, matcher))


def _answer(request: Message, extractor: Extractor | None, matcher: Matcher | None) -> Message:
    header, arrays = request
    try:
        if header["do"] == "extract" and extractor is not None:
            return pack_features(extractor.extract(arrays[0]))
        if header["do"] == "match" and matcher is not None:
            a, b = unpack_features(header["a"], arrays[:2]), unpack_features(header["b"], arrays[2:])
            found = matcher.match(a, b)
            return {}, [found.indices.astype(np.int64), found.similarity]
    except cv2.error as error:
        return {"error": f"OpenCV says: {_short(str(getattr(error, 'err', error)))}."}, []
    except (FeatureError, WireError, ValueError, IndexError) as error:
        return {"error": _short(str(error)) + "."}, []
    except MemoryError:
        return {"error": "It does not fit into memory."}, []
    return {"error": "It was not asked for."}, []


def _short(text: str) -> str:
    return " ".join(text.split())[:200].rstrip(". ")


if __name__ == "__main__":
    sys.exit(main())
