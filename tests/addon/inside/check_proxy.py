"""Make Proxy: a mesh on the splat, worn as its use wants it, added or exchanged as asked, and nothing at all where it fails."""

from types import SimpleNamespace

import numpy as np
import pytest
from mesh_depth import mesh_depth
from panels_drawn import Layout
from samples import counts

from core.proxy import ProxySettings

QUICK = {"faces": 3000, "long_side_px": 120}


def make(bpy, **options):
    return bpy.ops.gssmc.make_proxy(**{**QUICK, **options})


def proxies(scene, extension):
    return extension("gssmc_addon.proxy.objects").proxies_of(scene.gssmc.splat)


def stand(scene, extension, truths):
    bridge = extension("gssmc_addon.camera.bridge")
    cameras = extension("gssmc_addon.photo.list").cameras(scene)
    for camera, truth in zip(cameras, truths, strict=True):
        other = extension("core.geometry.camera")
        lens = other.Intrinsics(
            **{f: getattr(truth.intrinsics, f) for f in ("width", "height", "fx", "fy", "cx", "cy", "dist")}
        )
        bridge.write_camera(scene, camera, scene.gssmc.splat, other.Camera(lens, other.Pose(truth.pose.R, truth.pose.t)))
    return cameras


def test_the_mesh_lies_on_the_splat_and_goes_with_it(bpy, listed, place, extension):
    room, truths, _ = place
    scene = listed
    scene.camera = stand(scene, extension, truths)[0]
    assert make(bpy) == {"FINISHED"}
    (proxy,) = proxies(scene, extension)
    mesh = proxy.data
    assert proxy.parent == scene.gssmc.splat and [c.name for c in proxy.users_collection] == ["Proxies"]
    assert 1000 < len(mesh.polygons) <= 3000 and not mesh.validate()
    places = np.array([v.co for v in mesh.vertices])
    faces = np.array([p.vertices[:] for p in mesh.polygons])
    drawn = room.renderer.render(truths[0].intrinsics, truths[0].pose)
    depth = mesh_depth(places, faces, truths[0])
    seen = depth > 0
    assert seen.mean() > 0.85
    assert np.median(np.abs(depth / drawn.depth - 1)[seen]) < 0.01
    splat = scene.gssmc.splat
    splat.location, splat.scale = (3, 4, 5), (2, 2, 2)
    bpy.context.view_layer.update()
    assert np.allclose(proxy.matrix_world, splat.matrix_world)
    color = mesh.color_attributes["Color"].data[0].color
    assert 0 < max(color[:3]) <= 1
    assert mesh.uv_layers[0].name == scene.camera.name


@pytest.mark.parametrize(
    ("use", "worn"),
    [
        ("SHADOW_CATCHER", {"is_shadow_catcher": True, "is_holdout": False, "hide_render": False}),
        ("HOLDOUT", {"is_shadow_catcher": False, "is_holdout": True, "hide_render": False}),
        ("COLLISION", {"is_shadow_catcher": False, "is_holdout": False, "hide_render": True}),
        ("SNAP", {"is_shadow_catcher": False, "is_holdout": False, "hide_render": True}),
    ],
)
def test_each_use_is_worn_as_blender_knows_it(bpy, listed, extension, use, worn):
    assert make(bpy, use=use, faces=500) == {"FINISHED"}
    (proxy,) = proxies(listed, extension)
    assert {name: getattr(proxy, name) for name in worn} == worn
    assert proxy.gssmc.proxy_use == use
    assert (proxy.collision is not None) == (use == "COLLISION")


def test_another_one_is_added_unless_the_earlier_is_to_be_replaced(bpy, listed, extension):
    make(bpy, faces=500)
    first = proxies(listed, extension)[0]
    before = first.data.name
    first.location.x, first.name = 0.5, "Mine"
    make(bpy, faces=400, replace=True)
    (kept,) = proxies(listed, extension)
    assert kept == first and kept.name == "Mine" and kept.location.x == 0.5
    assert len(kept.data.polygons) <= 400 and [m.name for m in bpy.data.meshes] == [before]
    make(bpy, faces=400)
    assert len(proxies(listed, extension)) == 2
    assert make(bpy, faces=400, use="SNAP", replace=True) == {"FINISHED"}  # none of that use is there yet
    assert len(proxies(listed, extension)) == 3
    bpy.data.objects.remove(kept)
    assert len(proxies(listed, extension)) == 2


def test_solved_photos_and_solved_frames_are_taken(bpy, listed, place, extension):
    scene = listed
    with pytest.raises(RuntimeError, match="No photo of the list has a camera that holds"):
        make(bpy, cameras="PHOTOS")
    with pytest.raises(RuntimeError, match="is not solved; use Track Every Frame first"):
        make(bpy, cameras="PLATE")
    cameras = stand(scene, extension, place[1])
    for camera in cameras[:2]:
        camera.data.gssmc.verdict = "TRUSTED"
    assert make(bpy, cameras="PHOTOS") == {"FINISHED"}
    assert {layer.name for layer in proxies(scene, extension)[0].data.uv_layers} == {c.name for c in cameras[:2]}


def test_what_fails_changes_nothing(bpy, listed, extension):
    scene, before = listed, counts(bpy)
    with pytest.raises(RuntimeError, match="There is no object"):
        make(bpy, camera="nobody")
    scene.camera.location = (500, 500, 500)
    with pytest.raises(RuntimeError, match="show nothing of the scan"):
        make(bpy)
    assert counts(bpy) == before and len(bpy.data.meshes) == 0 and "Proxies" not in bpy.data.collections


def test_a_job_that_is_cancelled_ends_within_a_second(bpy, listed, extension):
    job_of, slot = extension("gssmc_addon.proxy.job").ProxyJob, extension("gssmc_addon.jobs.slot")
    cameras = extension("gssmc_addon.proxy.cameras").cameras_of(listed, listed.gssmc.splat, listed.camera, "ACTIVE", 1)
    settings = extension("core.proxy").ProxySettings(faces=ProxySettings().faces, long_side_px=2000)
    job = job_of(listed, listed.gssmc.splat, cameras * 5, settings)
    job._copying.finish()
    slot.begin(bpy.context, job)
    while job.tick() is None and job.fraction == 0 and not job.detail:
        job.join(0.05)
    slot.stop(job)
    assert job.join(1.0) and slot.active() is None and len(bpy.data.meshes) == 0


def test_the_panel_names_what_there_is(bpy, listed, extension):
    def said():
        layout = Layout()
        system = SimpleNamespace(system=SimpleNamespace(ui_scale=1))
        seen = SimpleNamespace(scene=listed, preferences=system, region=SimpleNamespace(width=2000))
        extension("gssmc_addon.proxy.panel").GSSMC_PT_proxy.draw(SimpleNamespace(layout=layout), seen)
        return layout.said

    assert said()[0] == "gssmc.make_proxy" and "casts shadows on it" in " ".join(said())
    make(bpy, use="COLLISION", faces=300)
    assert said() == ["gssmc.make_proxy", "name", "Collision", "hide_viewport"]
