"""The public interface: its names, what importing them costs, and the page that describes them."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import core
from core.synthetic import write_sample

REPO = Path(__file__).parents[2]
PAGE = REPO / "docs" / "api.md"


def python(code):
    return subprocess.run([sys.executable, "-c", code], cwd=REPO, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.process
def test_importing_the_package_imports_nothing_more():
    """Children of the engine import it too, and most of them need a small part."""
    done = python("import sys, core; print(sorted(m for m in sys.modules if m.startswith(('core', 'numpy', 'cv2', 'scipy'))))")
    assert done.stdout.strip() == "['core']", done.stdout + done.stderr


def test_every_public_name_is_there_and_no_other():
    for name in core.__all__:
        assert getattr(core, name).__name__ == name
    assert set(core.__all__) <= set(dir(core))
    with pytest.raises(AttributeError, match="no attribute 'Refine'"):
        core.Refine  # noqa: B018


@pytest.mark.process
def test_the_page_is_what_the_code_says():
    command = [sys.executable, str(REPO / "tools" / "api_page.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_public_name_has_its_section():
    headings = re.findall(r"^### (\w+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[: len(core.__all__)] == core.__all__


@pytest.mark.loop
def test_the_example_of_the_page_finds_the_camera(tmp_path, capsys):
    write_sample(tmp_path)
    start = json.loads((tmp_path / "start.json").read_text())
    start = start["frames"][0] if "frames" in start else start
    (code,) = re.findall(r"```python run\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names = {"folder": str(tmp_path), **{k: start[k] for k in ("fx", "fy", "cx", "cy", "R", "t")}}
    exec(compile(code, "api.md", "exec"), names)
    assert capsys.readouterr().out.startswith("trusted [")
