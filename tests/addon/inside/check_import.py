"""File > Import > Gaussian Splats: the layout, its way through a saved file, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from samples import counts, random_gaussians, write_ply

DATA = Path(__file__).parents[2] / "data"


def attribute(obj, name, width):
    data = obj.data.attributes[name].data
    member = next(m for m in ("vector", "value", "color") if m in data[0].bl_rna.properties)
    values = np.empty(len(data) * width, np.float32)
    data.foreach_get(member, values)
    return values.reshape(-1, width)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_layout_of_native_splats(bpy, tmp_path, degree):
    raw = random_gaussians(50, degree)
    assert bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "scan.ply", raw))) == {"FINISHED"}
    obj = bpy.context.scene.gssmc.splat
    assert obj.type == "POINTCLOUD"
    assert obj is bpy.context.view_layer.objects.active

    def stack(*names):
        return np.stack([raw[n] for n in names], axis=1)

    rotation = stack("rot_0", "rot_1", "rot_2", "rot_3").astype(np.float64)
    base = np.concatenate([stack("f_dc_0", "f_dc_1", "f_dc_2"), 1 / (1 + np.exp(-stack("opacity")))], axis=1)
    np.testing.assert_array_equal(attribute(obj, "position", 3), stack("x", "y", "z"))
    np.testing.assert_allclose(attribute(obj, "scale", 3), np.exp(stack("scale_0", "scale_1", "scale_2")), rtol=1e-6)
    np.testing.assert_allclose(
        attribute(obj, "rotation", 4), rotation / np.linalg.norm(rotation, axis=1, keepdims=True), atol=1e-6
    )
    np.testing.assert_allclose(attribute(obj, "radiance:base", 4), base, atol=1e-6)
    bands = (degree + 1) ** 2 - 1
    for k in range(bands):  # f_rest is channel-major: all of red, then green, then blue
        expected = stack(*(f"f_rest_{channel * bands + k}" for channel in range(3)))
        np.testing.assert_array_equal(attribute(obj, f"radiance:sh_{k}", 3), expected)
    assert f"radiance:sh_{bands}" not in obj.data.attributes


def test_complete_after_saving_and_opening(bpy, extension, tmp_path, splat_file):
    read = extension("gssmc_addon.splat.copy").read_splat
    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    before = read(bpy.context.scene.gssmc.splat)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scan.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scan.blend"))
    after = read(bpy.context.scene.gssmc.splat)
    for name in ("means", "scales", "rotations", "opacities", "sh"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_the_object_holds_what_the_reader_read(bpy, extension, splat_file):
    from core.splats import read_splats

    bpy.ops.gssmc.import_splats(filepath=str(splat_file))
    got = extension("gssmc_addon.splat.copy").read_splat(bpy.context.scene.gssmc.splat)
    wanted = read_splats(splat_file)
    for name in ("means", "scales", "rotations", "opacities", "sh"):
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name))


def test_a_level_of_a_streamed_scan(bpy):
    """Level 0 has 24 Gaussians, level 1 those 15 of them with x < 0."""
    file = DATA / "streamed_by_splat_transform" / "lod-meta.json"
    for level, count in ((0, 24), (1, 15)):
        assert bpy.ops.gssmc.import_splats(filepath=str(file), level=level) == {"FINISHED"}
        assert len(bpy.context.scene.gssmc.splat.data.points) == count


@pytest.mark.parametrize(
    ("orientation", "up"), [("Y_DOWN", (0, -1, 0)), ("Y_UP", (0, 1, 0)), ("Z_UP", (0, 0, 1)), ("Z_DOWN", (0, 0, -1))]
)
def test_orientation_turns_the_object_not_its_points(bpy, splat_file, orientation, up):
    from mathutils import Vector

    bpy.ops.gssmc.import_splats(filepath=str(splat_file), orientation=orientation)
    obj = bpy.context.scene.gssmc.splat
    bpy.context.view_layer.update()
    assert (obj.matrix_world @ Vector(up) - Vector((0, 0, 1))).length < 1e-6
    np.testing.assert_array_equal(attribute(obj, "position", 3)[:, 0], random_gaussians(200, 1)["x"])


def mesh_ply(path):
    return write_ply(path, {axis: np.zeros(3, np.float32) for axis in "xyz"})


def truncated(path):
    write_ply(path, random_gaussians(100, 0))
    path.write_bytes(path.read_bytes()[:-200])
    return path


def empty(path):
    path.write_bytes(b"")
    return path


def no_gaussians(path):
    return write_ply(path, random_gaussians(0, 0))


def wrong_sh_count(path):
    columns = random_gaussians(10, 1)
    del columns["f_rest_8"]
    return write_ply(path, columns)


def all_nan(path):
    columns = random_gaussians(10, 0)
    columns["x"][:] = np.nan
    return write_ply(path, columns)


@pytest.mark.parametrize("make", [lambda path: path, empty, mesh_ply, truncated, no_gaussians, wrong_sh_count, all_nan])
def test_a_bad_file_is_one_sentence_and_no_data(bpy, tmp_path, make):
    before = counts(bpy)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.gssmc.import_splats(filepath=str(make(tmp_path / "bad.ply")))
    message = str(error.value).strip()
    assert "Traceback" not in message
    assert "\n" not in message
    assert message.endswith(".")
    assert counts(bpy) == before
    assert bpy.context.scene.gssmc.splat is None


def test_gaussians_that_are_not_finite_are_left_out(bpy, tmp_path):
    columns = random_gaussians(10, 0)
    columns["y"][3] = np.inf
    columns["opacity"][7] = np.nan
    bpy.ops.gssmc.import_splats(filepath=str(write_ply(tmp_path / "scan.ply", columns)))
    assert len(bpy.context.scene.gssmc.splat.data.points) == 8


def foreign_splat(bpy, extension, bands=0, base_type="FLOAT_COLOR"):
    """A point cloud in the native layout, as another importer makes it."""
    if bpy.app.version < (5, 0) and base_type == "FLOAT4":
        pytest.skip("this Blender has no attributes of four plain floats")
    rng = np.random.default_rng(5)
    cloud = extension("gssmc_addon.splat.cloud_size").new_cloud("foreign", 20)
    layout = {"position": ("FLOAT_VECTOR", 3), "scale": ("FLOAT_VECTOR", 3), "rotation": ("QUATERNION", 4)}
    layout |= {"radiance:base": (base_type, 4), **{f"radiance:sh_{k}": ("FLOAT_VECTOR", 3) for k in range(bands)}}
    members = {"FLOAT_VECTOR": "vector", "QUATERNION": "value", "FLOAT_COLOR": "color", "FLOAT4": "vector"}
    values = {}
    for name, (kind, width) in layout.items():
        target = cloud.attributes.get(name) or cloud.attributes.new(name, kind, "POINT")
        values[name] = rng.uniform(0.1, 0.9, (20, width)).astype(np.float32)
        target.data.foreach_set("vector" if name == "position" else members[kind], values[name].ravel())
    obj = bpy.data.objects.new("foreign", cloud)
    bpy.context.scene.collection.objects.link(obj)
    return obj, values


@pytest.mark.parametrize(("bands", "degree"), [(0, 0), (3, 1), (8, 2), (15, 3), (24, 3)])
@pytest.mark.parametrize("base_type", ["FLOAT_COLOR", "FLOAT4"])
def test_a_splat_of_another_importer_can_be_picked(bpy, extension, bands, degree, base_type):
    obj, values = foreign_splat(bpy, extension, bands, base_type)
    bpy.context.scene.gssmc.splat = obj
    scene = extension("gssmc_addon.splat.copy").read_splat(bpy.context.scene.gssmc.splat)
    assert scene.sh_degree == degree
    np.testing.assert_array_equal(scene.means, values["position"])
    np.testing.assert_array_equal(scene.opacities, values["radiance:base"][:, 3])
    np.testing.assert_array_equal(scene.sh[:, 0], values["radiance:base"][:, :3])
    for k in range((degree + 1) ** 2 - 1):
        np.testing.assert_array_equal(scene.sh[:, k + 1], values[f"radiance:sh_{k}"])


def test_what_is_no_splat_is_told_apart(bpy, extension):
    splat_object = extension("gssmc_addon.splat.object")
    plain = bpy.data.objects.new("plain", bpy.data.pointclouds.new("plain"))
    mesh = bpy.data.objects.new("mesh", bpy.data.meshes.new("mesh"))
    splat, _ = foreign_splat(bpy, extension)
    assert [splat_object.is_splat(o) for o in (plain, mesh, None, splat)] == [False, False, False, True]
    with pytest.raises(extension("core.errors").SplatFormatError, match="plain"):
        extension("gssmc_addon.splat.copy").read_splat(plain)


def packed_file(folder, kind):
    """A scan of 300 Gaussians in a packed format, put together by hand."""
    from splat_files import random_chunk_ply, splat_bytes, splat_records, spz_bytes, spz_rows

    data = {
        "splat": lambda: splat_bytes(splat_records(300)),
        "spz": lambda: spz_bytes(spz_rows(300, 2), 3, 2),
        "ply": lambda: random_chunk_ply(300, 1)[0],
    }[kind]()
    path = folder / f"packed.{kind}"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("kind", "words", "up"),
    [
        ("splat", ["Format: splat", "300 Gaussians, SH degree 0", "Up axis: Y Down"], (0, -1, 0)),
        (
            "spz",
            ["Format: spz version 3", "300 Gaussians, SH degree 2", "Up axis: Y Up"],
            (0, 1, 0),
        ),
        (
            "ply",
            ["Format: compressed ply", "300 Gaussians, SH degree 1", "Up axis: Y Down"],
            (0, -1, 0),
        ),
    ],
)
def test_packed_formats_come_in_upright_by_their_convention(bpy, extension, tmp_path, kind, words, up):
    from mathutils import Vector

    from core.splats import read_splats

    path = packed_file(tmp_path, kind)
    words[-1] += ", as is usual for this format"  # a guess, told as one
    assert extension("gssmc_addon.splat.importer").describe(str(path)) == words
    assert bpy.ops.gssmc.import_splats(filepath=str(path)) == {"FINISHED"}
    obj = bpy.context.scene.gssmc.splat
    bpy.context.view_layer.update()
    assert (obj.matrix_world @ Vector(up) - Vector((0, 0, 1))).length < 1e-6
    got, wanted = extension("gssmc_addon.splat.copy").read_splat(obj), read_splats(path)
    for name in ("means", "scales", "rotations", "opacities", "sh"):
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name))


@pytest.mark.parametrize("declared", [True, False])
def test_the_dialog_tells_what_the_file_says_from_what_is_usual(extension, tmp_path, declared):
    import struct

    from splat_files import spz4_bytes, spz_rows

    path, coordinates, frame = tmp_path / "scan.spz", 0xADBE0003, 4
    path.write_bytes(spz4_bytes(spz_rows(30, 1), 1, records=struct.pack("<III", coordinates, 4, frame if declared else 0)))
    told = extension("gssmc_addon.splat.importer").describe(str(path))[-1]
    assert told.endswith("as the file says" if declared else "as is usual for this format"), told


def test_the_dialog_says_why_a_file_cannot_be_imported(extension, tmp_path):
    describe = extension("gssmc_addon.splat.importer").describe
    (tmp_path / "scene.sog").write_bytes(b"PK\x03\x04" + bytes(80))
    assert "is no .sog scene" in describe(str(tmp_path / "scene.sog"))[0]
    assert describe(str(tmp_path / "nothing"))[0].startswith("Choose a splat file: .ply")
