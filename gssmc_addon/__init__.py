"""The Blender side of GS-SMC: registers its classes in their order."""

from __future__ import annotations

import bpy

from ..operators import (
    add_photo,
    add_photo_folder,
    add_photos,
    add_pin,
    add_plate,
    back_to_solution,
    camera_from_view,
    cancel,
    clear_maps,
    drag_wipe,
    export_cameras,
    export_splats,
    find_camera,
    import_cameras,
    import_splats,
    look,
    look_through_card,
    make_proxy,
    match_resolution,
    models,
    pin_frame,
    place_by_pins,
    preview,
    refine,
    refine_all,
    refine_sequence,
    remove_composite,
    remove_photo,
    remove_pin,
    render_splat,
    report_problem,
    reset_settings,
    review,
    same_lens,
    set_floor,
    set_mask,
    set_masks,
    set_scale,
    set_up_composite,
    solve_pins,
    track_plate,
    undistort_photo,
    undistort_plate,
    up_axis,
    weak_frame,
)
from .camera import frame as camera_frame
from .composite import panel as composite_panel
from .composite import watch as composite_watch
from .floor import panel as floor_panel
from .headless import command as cli
from .jobs import slot
from .look import cards
from .photo import panel as photo_panel
from .pins import marks
from .pins import panel as pins_panel
from .plate import panel as plate_panel
from .plate.track import plot as frame_plot
from .preview import flicker
from .preview import panel as preview_panel
from .preview import watch as preview_watch
from .proxy import panel as proxy_panel
from .refine import panel as panels
from .registration import menus, preferences, properties
from .render_gpu import device
from .viewport import handlers as viewport

_class_modules = (
    models,
    preferences,
    import_splats,
    add_photo,
    refine,
    find_camera,
    clear_maps,
    cancel,
    add_photos,
    add_photo_folder,
    remove_photo,
    refine_all,
    review,
    same_lens,
    set_mask,
    set_masks,
    look,
    look_through_card,
    drag_wipe,
    preview,
    import_cameras,
    export_cameras,
    export_splats,
    camera_from_view,
    back_to_solution,
    match_resolution,
    undistort_photo,
    undistort_plate,
    up_axis,
    report_problem,
    reset_settings,
    add_plate,
    track_plate,
    refine_sequence,
    pin_frame,
    weak_frame,
    add_pin,
    remove_pin,
    solve_pins,
    place_by_pins,
    set_floor,
    set_scale,
    make_proxy,
    set_up_composite,
    remove_composite,
    render_splat,
    panels,
    pins_panel,
    photo_panel,
    preview_panel,
    plate_panel,
    floor_panel,
    proxy_panel,
    composite_panel,
    menus,
)
_cli_commands: list[object] = []


def register() -> None:
    properties.register()
    for module in _class_modules:
        for cls in module.classes:
            bpy.utils.register_class(cls)
    menus.register()
    frame_plot.register()
    preferences.register()
    slot.register()
    camera_frame.register()
    viewport.register()
    cards.register()
    marks.register()
    composite_watch.register()
    preview_watch.register()
    _cli_commands.append(bpy.utils.register_cli_command("gssmc", cli.main))


def unregister() -> None:
    slot.unregister()  # The jobs end first, because a running one uses all the rest.
    device.unregister()
    preview_watch.unregister()
    cards.unregister()
    composite_watch.unregister()
    marks.unregister()
    viewport.unregister()
    camera_frame.unregister()
    flicker.unregister()
    while _cli_commands:
        bpy.utils.unregister_cli_command(_cli_commands.pop())
    preferences.unregister()
    frame_plot.unregister()
    menus.unregister()
    for module in reversed(_class_modules):
        for cls in reversed(module.classes):
            bpy.utils.unregister_class(cls)
    properties.unregister()
