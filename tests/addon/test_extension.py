"""Ring 2: the built zip, installed into a fresh user directory of the real bpy, driven through its operators.

Each `inside/check_*.py` is a pytest module that runs in a Blender process of its own: a crash there fails one test here.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

HERE = Path(__file__).parent
REPO = HERE.parents[1]
CHECKS = sorted((HERE / "inside").glob("check_*.py"))
LIMIT_S = 240
# Blender 4.5 LTS, set up by `scripts/setup.sh --all`. It is spared the examples of docs/ and the real scan, the longest checks,
# which call no operator that the others do not (check_operators sees to that).
PYTHON_45 = REPO / ".venv45" / "bin" / "python"
CHECKS_45 = [check for check in CHECKS if check.stem not in ("check_docs", "check_fox")]

PYTHONS = {"test_inside_blender": sys.executable, "test_inside_blender_45": str(PYTHON_45)}
ENVIRONMENT = dict(os.environ)  # copied once: pytest changes it while the checks are started from threads
AT_ONCE = 2  # most checks keep one core busy

pytest.importorskip("bpy", reason="ring 2 needs Blender as a Python module (bpy)")


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    """The extension without wheels: the test environment already has what they would bring."""
    out = tmp_path_factory.mktemp("dist")
    build = [sys.executable, str(REPO / "tools" / "build_extension.py"), "--no-wheels", "--out", str(out)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("gssmc-*.zip"))


@pytest.fixture(scope="session")
def runs(request, extension_zip, tmp_path_factory):
    """Every check of this session that is to run in a Blender, started: AT_ONCE at a time, in the order of the tests."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        started = {}
        for item in request.session.items:
            python = PYTHONS.get(getattr(item, "originalname", ""))
            if python and not any(mark.args[0] for mark in item.iter_markers("skipif")):
                folder = tmp_path_factory.mktemp(item.callspec.id)
                started[item.nodeid] = pool.submit(run_inside, python, item.callspec.params["check"], extension_zip, folder)
        yield started
        pool.shutdown(cancel_futures=True)


@pytest.mark.parametrize("check", CHECKS, ids=[c.stem for c in CHECKS])
def test_inside_blender(check, runs, request):
    assert_passed(runs[request.node.nodeid].result())


@pytest.mark.skipif(not PYTHON_45.exists(), reason="Blender 4.5 is not set up; run scripts/setup.sh --all")
@pytest.mark.parametrize("check", CHECKS_45, ids=[c.stem for c in CHECKS_45])
def test_inside_blender_45(check, runs, request):
    assert_passed(runs[request.node.nodeid].result())


def run_inside(python, check, extension_zip, tmp_path):
    """What came of the check, as `subprocess.run` has it."""
    environment = dict(ENVIRONMENT, BLENDER_USER_RESOURCES=str(tmp_path / "blender"), GSSMC_ZIP=str(extension_zip))
    command = [python, "-m", "pytest", "-p", "no:cacheprovider", "-o", "python_files=check_*.py"]
    command += [
        "-o",
        f"pythonpath=. tests/core/support tests/core/features tests/core/pose {HERE / 'inside'}",
        "-rs",
        str(check),
    ]
    return subprocess.run(command, cwd=REPO, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False)


def assert_passed(done):
    assert done.returncode == 0, f"{done.stdout[-8000:]}\n{done.stderr[-2000:]}"


def test_there_is_something_to_check():
    assert len(CHECKS) >= 4
