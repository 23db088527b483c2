"""Ring 2: the built zip, installed into a fresh user directory of the real bpy, driven through its operators.

Each `inside/check_*.py` is a pytest module that runs in a Blender process of its own: a crash there fails one test here.
`inside/plan.py` says which of them run in which Blender.
"""

import os
import subprocess
import sys
from pathlib import Path

import plan
import pytest

HERE = Path(__file__).parent
REPO = HERE.parents[1]
LIMIT_S = 480  # far beyond what any check takes, so that only one that hangs is ended
# A test run that is divided among processes (pytest-xdist) tells each of them so, which is not meant for those inside Blender.
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_XDIST")}
PYTHONS = {
    (4, 5): REPO / ".venv45" / "bin" / "python",
    (5, 2): Path(sys.executable),
    (5, 3): REPO / ".venv53" / "bin" / "python",
}
SCANS = ("check_fox", "check_native", "check_render_gpu")  # some of their tests need ../shared

pytest.importorskip("bpy", reason="ring 2 needs Blender as a Python module (bpy)")


def name_of(blender):
    """What tests and marks of a Blender other than .venv's end with: 45 or 53."""
    return "" if blender == plan.MAIN else "".join(map(str, blender))


def marks(blender, checks):
    yield getattr(pytest.mark, f"blender{name_of(blender)}")
    if {check.stem for check in checks} & set(SCANS):
        yield pytest.mark.scan
    if not PYTHONS[blender].exists():
        yield pytest.mark.skip(f"Blender {'.'.join(map(str, blender))} is not set up; run scripts/setup.sh --all")


PARAMETERS = [
    pytest.param(blender, checks, id=name + name_of(blender), marks=[*marks(blender, checks)])
    for blender in plan.BLENDERS
    for name, checks in plan.runs(blender)
]


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    """The extension without wheels: the test environment already has what they would bring."""
    out = tmp_path_factory.mktemp("dist")
    build = [sys.executable, str(REPO / "tools" / "build_extension.py"), "--no-wheels", "--out", str(out)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("gssmc-*.zip"))


@pytest.mark.parametrize(("blender", "checks"), PARAMETERS)
def test_inside_blender(blender, checks, extension_zip, tmp_path):
    done = run_inside(PYTHONS[blender], checks, extension_zip, tmp_path)
    assert done.returncode == 0, f"{done.stdout[-8000:]}\n{done.stderr[-2000:]}"


def run_inside(python, checks, extension_zip, tmp_path):
    """What came of the checks, as `subprocess.run` has it."""
    environment = dict(ENVIRONMENT, BLENDER_USER_RESOURCES=str(tmp_path / "blender"), GSSMC_ZIP=str(extension_zip))
    command = [str(python), "-m", "pytest", "-p", "no:cacheprovider", "-o", "python_files=check_*.py"]
    command += ["-o", f"pythonpath=. tests/core/support {HERE / 'inside'}", "-rs", *map(str, checks)]
    return subprocess.run(command, cwd=REPO, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False)


def test_there_is_something_to_check():
    assert len(plan.ALL) >= 4
    assert {check.stem for check in plan.checks(plan.MAIN)} | set(plan.SINCE) == {check.stem for check in plan.ALL}
    for blender in plan.BLENDERS:
        run = [check for _, checks in plan.runs(blender) for check in checks]
        assert sorted(run) == sorted(plan.checks(blender))
