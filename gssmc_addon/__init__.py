"""The Blender side of GS-SMC: what is registered, in which order."""

from __future__ import annotations

import bpy

from ..operators import (
    add_photo,
    camera_from_view,
    cancel,
    export_cameras,
    import_cameras,
    import_splats,
    match_resolution,
    models,
    refine,
    report_problem,
    undistort_photo,
)
from . import cli, jobs, menus, panels, preferences, properties

_class_modules = (models, preferences, import_splats, add_photo, refine, cancel, panels, menus)
_class_modules += (import_cameras, export_cameras, camera_from_view, match_resolution, undistort_photo, report_problem)
_cli_commands: list[object] = []


def register() -> None:
    properties.register()
    for module in _class_modules:
        for cls in module.classes:
            bpy.utils.register_class(cls)
    menus.register()
    preferences.register()
    jobs.register()
    _cli_commands.append(bpy.utils.register_cli_command("gssmc", cli.main))


def unregister() -> None:
    jobs.unregister()  # first: a running job uses all the rest
    while _cli_commands:
        bpy.utils.unregister_cli_command(_cli_commands.pop())
    preferences.unregister()
    menus.unregister()
    for module in reversed(_class_modules):
        for cls in reversed(module.classes):
            bpy.utils.unregister_class(cls)
    properties.unregister()
