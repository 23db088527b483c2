"""Every test belongs to one ring: by its folder, unless its module or the test itself is marked with another.

`unit`, `loop`, `process`, `blender`, `blender45`, `blender53` and `window` are the rings (pyproject.toml says what each holds);
`scan` may stand beside one of them.
"""

from pathlib import Path

import pytest

HERE = Path(__file__).parent
RINGS = frozenset({"unit", "loop", "process", "blender", "blender45", "blender53", "window"})
RING_OF_FOLDER = {"core": "unit", "core/batch": "process", "core/cli": "loop", "addon": "blender", "ui": "window"}


def rings(item):
    """The rings that an item is marked with."""
    return {mark.name for mark in item.iter_markers()} & RINGS


def ring_of_folder(path):
    """The ring of the innermost folder that has one; tests at the top are small ones."""
    folders = path.relative_to(HERE).parents
    return next((RING_OF_FOLDER[f.as_posix()] for f in folders if f.as_posix() in RING_OF_FOLDER), "unit")


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    for item in items:
        if not rings(item):
            item.add_marker(ring_of_folder(item.path))
        if len(rings(item)) != 1:
            raise pytest.UsageError(f"{item.nodeid} is marked {' and '.join(sorted(rings(item)))}; choose one ring.")
