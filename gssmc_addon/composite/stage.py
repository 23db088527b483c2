"""Who plays which part in the render: the splat is hidden, its proxies catch shadows or hide what is behind them."""

from __future__ import annotations

import json

import bpy

from ..proxy.objects import proxies_of
from ..splat import object as splat_object
from ..support.texts import rpt_
from . import record, shared
from .state import GssmcComposite

CYCLES = "CYCLES"
CATCHER, HOLDOUT = "SHADOW_CATCHER", "HOLDOUT"


def used_proxies(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The proxies of the picked splat that stand for it in the render."""
    splat = scene.gssmc.splat
    return [p for p in proxies_of(splat) if p.gssmc.proxy_use in (CATCHER, HOLDOUT)] if splat else []


def set_stage(scene: bpy.types.Scene, kept: GssmcComposite, by_depth: bool) -> list[str]:
    """Sets splats and proxies for the render engine that the scene has, each noted in `kept` as it was. Sentences on it.

    `by_depth`: a render of the splat hides CG by its own depth where there is no proxy.
    """
    splat, cycles = scene.gssmc.splat, scene.render.engine == CYCLES
    used = used_proxies(scene)
    for proxy in used:
        catches = cycles and proxy.gssmc.proxy_use == CATCHER
        _touch(kept, proxy, hide_render=False, is_shadow_catcher=catches, is_holdout=not catches)
    # A native splat that is held out hides CG finer than any mesh, but takes the light off the mesh that catches shadows.
    holds_out = cycles and not used and not by_depth and splat is not None and splat_object.is_native(splat.data)
    for obj in scene.objects:
        if splat_object.is_splat(obj):
            keeps = holds_out and obj == splat
            _touch(kept, obj, hide_render=not keeps, is_holdout=keeps)
    return [] if by_depth and not used else _notes(used, cycles, holds_out)


def _touch(kept: GssmcComposite, obj: bpy.types.Object, **wanted: bool) -> None:
    if not obj.is_editable:
        return
    item = kept.objects.add()
    item.object, item.before = obj, json.dumps(record.values(obj, record.OBJECT_PATHS))
    record.put(obj, wanted)
    item.after = json.dumps(record.values(obj, record.OBJECT_PATHS))
    shared.note(obj, item.before, item.after)


def _notes(used: list[bpy.types.Object], cycles: bool, holds_out: bool) -> list[str]:
    if holds_out:
        return [rpt_("The splat hides what is behind it; for shadows on it, press Make Proxy and set up again.")]
    if not used:
        return [rpt_("Nothing of the place hides CG or takes its shadows yet; press Make Proxy and set up again.")]
    if not cycles and any(proxy.gssmc.proxy_use == CATCHER for proxy in used):
        return [rpt_("Only Cycles catches shadows; with this engine the proxy hides what is behind it, and takes no shadows.")]
    return []
