"""`convert SCENE OUT`: what comes out is the same scan, turned as the format has it, and that is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from render_scenes import make_scene

from core.cli.main import main
from core.geometry.camera import Intrinsics, Pose
from core.geometry.conventions import orientation_matrix
from core.render import Renderer
from core.splats import read_splats
from core.splats.ply.reader import write_ply, write_ply_axes_kept

SCENE = make_scene(np.random.default_rng(0).normal(size=(60, 3)) * 0.6, 0.15, opacity=0.8)
LENS = Intrinsics(60, 40, 50.0, 50.0, 30.0, 20.0)
SOG = Path(__file__).parents[2] / "data" / "by_splat_transform.sog"


def run(capsys, *argv):
    code = main(["convert", *map(str, argv)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def upright_view(scene):
    """The scene as a camera sees it that stands upright among its axes, 5 units away."""
    stand = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) @ orientation_matrix(scene.orientation)[:3, :3]
    return Renderer(scene).render(LENS, Pose(stand, np.array([0.0, 0, 5.0]))).color


@pytest.mark.parametrize("axes", ["Y_DOWN", "Z_UP"])
@pytest.mark.parametrize("ending", [".ply", ".spz", ".splat", ".compressed.ply", ".sog"])
def test_the_scan_looks_as_before(tmp_path, capsys, axes, ending):
    source = replace(SCENE, orientation=axes)
    if ending == ".splat":
        source = replace(source, sh=source.sh[:, :1].copy())
    write_ply_axes_kept(tmp_path / "in.ply", source)
    code, said, warned = run(capsys, tmp_path / "in.ply", tmp_path / f"out{ending}")
    assert (code, said) == (0, f"The scan was written to '{tmp_path / f'out{ending}'}'.\n")
    scene = read_splats(tmp_path / f"out{ending}")
    assert ("is turned from" in warned) == (scene.orientation != axes)
    assert np.abs(upright_view(scene) - upright_view(read_splats(tmp_path / "in.ply"))).max() < 0.06


def test_sog_becomes_ply_and_others_are_not_written(tmp_path, capsys):
    assert run(capsys, SOG, tmp_path / "out.ply")[0] == 0
    np.testing.assert_allclose(read_splats(tmp_path / "out.ply").means, read_splats(SOG).means, rtol=1e-6)
    code, _, warned = run(capsys, SOG, tmp_path / "out.ksplat")
    assert code == 2 and "'.ksplat' files are not written; write .ply" in warned


def test_nothing_is_overwritten_and_what_is_lost_is_said(tmp_path, capsys):
    write_ply(tmp_path / "a.ply", replace(SCENE, antialiased=True))
    code, _, warned = run(capsys, tmp_path / "a.ply", tmp_path / "a.ply")
    assert code == 2 and "would overwrite the scan" in warned
    assert "drawn anti-aliased is lost" in run(capsys, tmp_path / "a.ply", tmp_path / "a.splat")[2]
    code, _, warned = run(capsys, tmp_path / "none.ply", tmp_path / "b.spz")
    assert code == 2 and "There is no splat file at" in warned
