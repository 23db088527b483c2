"""Every test belongs to one ring: by its folder or fixture, unless its module or the test itself is marked with another.

`unit`, `loop`, `process`, `blender`, `blender45`, `blender53` and `window` are the rings (pyproject.toml says what each holds);
`scan` may stand beside one of them.
"""

from pathlib import Path

import pytest

HERE = Path(__file__).parent
RINGS = frozenset({"unit", "loop", "process", "blender", "blender45", "blender53", "window"})
RING_OF_FOLDER = {"core/batch": "process", "core/processes": "process", "addon": "blender", "ui": "window"}
RING_OF_FIXTURE = {"place": "loop"}  # a room with photos, made to be refined


def rings(item):
    """The rings that an item is marked with."""
    return {mark.name for mark in item.iter_markers()} & RINGS


def group(item):
    """Tests of a group run in one process: those of a module share rooms and photos, a check inside Blender shares nothing."""
    return item.nodeid if item.path.name == "test_extension.py" else item.path.as_posix()


def default_ring(item):
    """The ring of the innermost folder that has one, else that of a fixture; else the test is a small one."""
    folders = (folder.as_posix() for folder in item.path.relative_to(HERE).parents)
    found = [RING_OF_FOLDER[f] for f in folders if f in RING_OF_FOLDER]
    found += [RING_OF_FIXTURE[f] for f in getattr(item, "fixturenames", ()) if f in RING_OF_FIXTURE]
    return next(iter(found), "unit")


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(config, items):
    divided = config.pluginmanager.hasplugin("xdist")
    for item in items:
        if divided:
            item.add_marker(pytest.mark.xdist_group(group(item)))
        if not rings(item):
            item.add_marker(default_ring(item))
        if len(rings(item)) != 1:
            raise pytest.UsageError(f"{item.nodeid} is marked {' and '.join(sorted(rings(item)))}; choose one ring.")
