"""OpenUSD with Gaussians: what the USD library itself writes; and where that library is not there, a sentence."""

import sys

import numpy as np
import pytest
from ply_files import ply_bytes, raw_table

from core.errors import SplatFormatError
from core.geometry.conventions import Similarity
from core.geometry.lie import so3_exp
from core.splats import check_splat_file, inspect_splats, read_splats
from core.splats.transform import transformed


@pytest.fixture
def source(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply_bytes(raw_table(24, 2, seed=5)))
    return read_splats(tmp_path / "a.ply")


@pytest.fixture
def usd():
    """The library's modules; Blender has it, plain Python only with the package usd-core."""
    pytest.importorskip("pxr", reason="the USD library is not in this Python")
    from pxr import Gf, Usd, UsdGeom, UsdUtils, UsdVol, Vt

    class Modules:
        pass

    for module in (Gf, Usd, UsdGeom, UsdUtils, UsdVol, Vt):
        setattr(Modules, module.__name__.rpartition(".")[2], module)
    return Modules


def put(usd, stage, path, scene, half=False):
    """Writes a scene as a prim, by the library's own classes."""
    prim = usd.UsdVol.ParticleField3DGaussianSplat.Define(stage, path)
    quaternion = usd.Gf.Quath if half else usd.Gf.Quatf
    turns = [quaternion(*map(float, q)) for q in scene.rotations]
    end = "h" if half else ""
    numbers = {"positions": scene.means, "scales": scene.scales, "opacities": scene.opacities}
    numbers["radiance:sphericalHarmonicsCoefficients"] = scene.sh.reshape(-1, 3)
    for name, values in numbers.items():
        kind = np.float16 if half else np.float32
        prim.GetPrim().GetAttribute(name + end).Set(values.astype(kind))
    prim.GetPrim().GetAttribute("orientations" + end).Set((usd.Vt.QuathArray if half else usd.Vt.QuatfArray)(turns))
    prim.GetPrim().GetAttribute("radiance:sphericalHarmonicsDegree").Set(scene.sh_degree)
    return prim


def same(scene, truth, within=1e-5):
    for name in ("means", "scales", "opacities", "sh"):
        np.testing.assert_allclose(getattr(scene, name), getattr(truth, name), rtol=within, atol=within, err_msg=name)
    assert np.abs((scene.rotations * truth.rotations).sum(axis=1)).min() > 1 - within


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_what_the_library_writes_is_read(usd, source, tmp_path, suffix):
    inner = tmp_path / ("a.usdc" if suffix == ".usdz" else f"a{suffix}")
    stage = usd.Usd.Stage.CreateNew(str(inner))
    put(usd, stage, "/World/Splat", source)
    stage.Save()
    path = tmp_path / f"a{suffix}"
    if suffix == ".usdz":
        assert usd.UsdUtils.CreateNewUsdzPackage(str(inner), str(path))
    scene, info = read_splats(path), inspect_splats(path)
    same(scene, source)
    assert check_splat_file(path).name == "OpenUSD"
    assert (info.count, info.sh_degree, info.orientation, info.declared) == (24, 2, "Y_UP", False)


def test_half_precision_several_prims_their_places_and_the_axes_of_the_stage(usd, source, tmp_path):
    stage = usd.Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    usd.UsdGeom.SetStageUpAxis(stage, usd.UsdGeom.Tokens.z)
    put(usd, stage, "/A", source, half=True)
    moved = put(usd, stage, "/B", source)
    angle = np.array([0.3, -0.2, 0.5])
    rotation = so3_exp(angle)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 2 * rotation, (1, 2, 3)
    moved.AddTransformOp().Set(usd.Gf.Matrix4d(*map(float, matrix.T.ravel())))
    stage.Save()
    scene = read_splats(tmp_path / "a.usda")
    assert (len(scene), scene.orientation) == (48, "Z_UP")
    other = transformed(source, Similarity(2.0, rotation, np.array([1.0, 2, 3])), "Z_UP")
    np.testing.assert_allclose(scene.means[:24], source.means, rtol=2e-3, atol=2e-3)
    np.testing.assert_allclose(scene.means[24:], other.means, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(scene.sh[24:], other.sh, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("case", ["no splats", "too few SH", "text cut", "sheared"])
def test_a_bad_stage_ends_in_one_sentence(usd, source, tmp_path, case):
    path = tmp_path / "a.usda"
    stage = usd.Usd.Stage.CreateNew(str(path))
    if case == "no splats":
        usd.UsdGeom.Sphere.Define(stage, "/A")
    else:
        prim = put(usd, stage, "/A", source)
        if case == "too few SH":
            prim.GetPrim().GetAttribute("radiance:sphericalHarmonicsDegree").Set(3)
        if case == "sheared":
            prim.AddScaleOp().Set(usd.Gf.Vec3f(1, 2, 1))
    stage.Save()
    if case == "text cut":
        path = tmp_path / "cut.usda"  # The library keeps in memory what it has open.
        path.write_bytes((tmp_path / "a.usda").read_bytes()[:3000])
    words = "holds no Gaussian splats" if case == "no splats" else "is damaged, or holds its Gaussians in an unknown way"
    with pytest.raises(SplatFormatError, match=words) as caught:
        read_splats(path)
    assert str(caught.value).endswith(".") and "\n" not in str(caught.value)


@pytest.mark.parametrize("start", [b"#usda 1.0\n", b"PXR-USDC" + bytes(80)])
def test_without_the_library_one_sentence_says_what_to_do(tmp_path, monkeypatch, start):
    monkeypatch.setitem(sys.modules, "pxr", None)
    (tmp_path / "a.usd").write_bytes(start)
    words = r"need Blender's own USD library.*import the file in Blender, or export it as \.ply"
    with pytest.raises(SplatFormatError, match=words):
        read_splats(tmp_path / "a.usd")
