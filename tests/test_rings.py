"""The rings of the tests: none is outside them, and none is in two."""

import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[1]

pytestmark = pytest.mark.process

RINGS = ("unit", "loop", "process", "blender", "blender45", "blender53", "window")


def chosen(expression, *more):
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--collect-only", "-m", expression, *more]
    return subprocess.run(command, cwd=REPO, capture_output=True, text=True, timeout=120, check=False)


def test_no_test_is_outside_the_rings():
    done = chosen(f"not ({' or '.join(RINGS)})")
    assert done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED, done.stdout[-2000:] + done.stderr[-2000:]


def test_a_test_in_two_rings_is_refused(tmp_path):
    file = tmp_path / "test_two.py"
    file.write_text("import pytest\n\n@pytest.mark.unit\n@pytest.mark.loop\ndef test_it():\n    pass\n")
    done = chosen("", "-c", str(REPO / "pyproject.toml"), "-p", "tests.conftest", str(file))
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "is marked loop and unit; choose one ring." in done.stdout + done.stderr
