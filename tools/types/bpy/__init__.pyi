# Blender's module as far as this extension uses it, for mypy. What is named here is checked; everything else is Any, and is
# checked where it counts: by the tests, which run the extension in each Blender. `gssmc` is what the extension adds.
from typing import Any

from . import app as app
from . import props as props
from . import types as types

context: types.Context
data: types.BlendData
ops: Any
path: Any
from . import utils as utils
