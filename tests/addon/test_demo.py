"""The command the README begins with."""

import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]

pytest.importorskip("bpy", reason="the demo needs Blender as a Python module (bpy)")


def test_the_demo_brings_its_camera_home(tmp_path):
    command = [sys.executable, str(REPO / "scripts" / "blender_demo.py"), "--out", str(tmp_path / "demo")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "verdict: trusted" in done.stdout
    blend = (tmp_path / "demo" / "sample.blend").read_bytes()
    assert blend[:4] in {b"BLEN", b"\x28\xb5\x2f\xfd"}  # plain, or compressed with zstd
    assert (tmp_path / "demo" / "before_after.png").read_bytes()[1:4] == b"PNG"
