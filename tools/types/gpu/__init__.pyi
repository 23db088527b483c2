from typing import Any

from . import types as types

matrix: Any
platform: Any
shader: Any
state: Any
texture: Any
