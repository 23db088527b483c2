"""Records that tell whether a disk, a network or a hand has changed them since they were written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SUM = "sum"
SUM_BYTES = 8


def sealed(record: Mapping[str, Any]) -> dict[str, Any]:
    """The record, which JSON can hold, with a checksum of all else in it under "sum"."""
    plain = {name: value for name, value in record.items() if name != SUM}
    return {**plain, SUM: _sum(plain)}


def is_sound(record: Mapping[str, Any]) -> bool:
    """Whether the record, as JSON gives it back, is what `sealed` made. One without a checksum is not."""
    return record.get(SUM) == _sum({name: value for name, value in record.items() if name != SUM})


def _sum(plain: dict[str, Any]) -> str:
    # Python writes every finite number so that it reads the same one back, hence the text is the same however it was laid out.
    return hashlib.blake2b(json.dumps(plain, sort_keys=True).encode(), digest_size=SUM_BYTES).hexdigest()
