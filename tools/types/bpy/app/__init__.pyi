from typing import Any

from . import handlers as handlers
from . import translations as translations

background: bool
build_platform: bytes
online_access: bool
timers: Any
version: tuple[int, int, int]
version_string: str

def is_job_running(job_type: str) -> bool: ...
