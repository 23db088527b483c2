"""The zip is one that every Blender it is for takes: by the validators of the Blenders that are set up here."""

import importlib.util
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

REPO = Path(__file__).parents[1]
# The extensions platform takes these tags of add-ons and no others (Blender's manual, Extensions Tags).
TAGS = """3D View,Add Curve,Add Mesh,Animation,Bake,Camera,Compositing,Development,Game Engine,Geometry Nodes,Grease Pencil,
Import-Export,Lighting,Material,Modeling,Mesh,Node,Object,Paint,Pipeline,Physics,Render,Rigging,Scene,Sculpt,Sequencer,System,
Text Editor,Tracking,User Interface,UV""".replace("\n", "").split(",")


@pytest.fixture(scope="module")
def tool():
    """tools/build_extension.py as a module."""
    spec = importlib.util.spec_from_file_location("build_extension", REPO / "tools" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def manifest():
    return tomllib.loads((REPO / "blender_manifest.toml").read_text())


def built(out, *more):
    pytest.importorskip("bpy", reason="the builder is part of Blender's module")
    command = [sys.executable, str(REPO / "tools" / "build_extension.py"), "--no-wheels", "--out", str(out), *more]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (archive,) = out.glob("*.zip")
    return archive


def test_tags_are_those_of_the_platform_and_what_is_bundled_is_named(manifest):
    assert set(manifest["tags"]) <= set(TAGS)
    assert {"Camera", "Tracking", "Import-Export"} <= set(manifest["tags"])
    owners = " ".join(manifest["copyright"])
    for name in ("GS-SMC", "plyfile", "SciPy", "OpenCV"):
        assert name in owners
    assert "website" not in manifest, "no address is true yet"


@pytest.mark.parametrize(("venv", "blender"), [(".venv45", "4.5"), (".venv", "5.2"), (".venv53", "5.3")])
@pytest.mark.parametrize("line", [False, True])
def test_the_validator_of_each_blender_takes_the_zip(tmp_path, venv, blender, line):
    validators = sorted(
        (REPO / venv).glob(f"lib/python*/site-packages/bpy/{blender}/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    )
    if not validators:
        pytest.skip(f"Blender {blender} is not set up; run scripts/setup.sh --all")
    archive = built(tmp_path, *(["--blender", blender] if line else []))
    command = [str(REPO / venv / "bin" / "python"), str(validators[0]), "validate", str(archive)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Success" in done.stdout


def test_a_zip_for_one_line_says_so(tmp_path):
    archive = built(tmp_path, "--blender", "4.5")
    assert archive.name.endswith("-blender4.5.zip")
    with zipfile.ZipFile(archive) as content:
        said = tomllib.loads(content.read("blender_manifest.toml").decode())
    assert (said["blender_version_min"], said["blender_version_max"]) == ("4.5.0", "5.1.0"), "Python 3.11 ends with 5.0"


def test_lines_follow_each_other_and_hold_one_python_each(tool):
    lines = [tool.LINES[name] for name in ("4.5", "5.2", "5.3")]
    assert [line.first for line in lines[1:]] == [line.beyond for line in lines[:-1]], "no Blender falls between two zips"
    for line in lines:
        assert len(line.pythons) == 1
        assert len(line.wheels) == 3
        assert ("scipy==1.17.1", "3.11") in line.wheels or ("scipy==1.18.1", "3.13") in line.wheels
    assert tool.Line().wheels == tool.WHEELS


def test_names_of_zips(tool):
    assert tool.archive_name("gssmc-0.1.0-linux_x64.zip", "5.2") == "gssmc-0.1.0-blender5.2-linux_x64.zip"
    assert tool.archive_name("gssmc-0.1.0.zip", "4.5") == "gssmc-0.1.0-blender4.5.zip"
    assert tool.archive_name("gssmc-0.1.0-linux_x64.zip", None) == "gssmc-0.1.0-linux_x64.zip"
