from typing import Any

from . import types as types

capabilities: Any
matrix: Any
platform: Any
shader: Any
state: Any
texture: Any

def init() -> None: ...
