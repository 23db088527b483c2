"""The examples of docs/, run as they stand."""

import re
import shlex
from pathlib import Path

import pytest

from core.synthetic import write_sample

REPO = Path(__file__).parents[3]
BLOCK = re.compile(r"^```(python|sh) run\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", ["scripting", "tutorial"])
def test_examples_run(bpy, extension, page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_sample(tmp_path)
    blocks = BLOCK.findall((REPO / "docs" / f"{page}.md").read_text())
    assert len(blocks) >= 4
    names = {"folder": str(tmp_path), "bpy": bpy}
    for kind, text in blocks:
        if kind == "python":
            exec(compile(text, f"{page}.md", "exec"), names)
            continue
        for line in text.splitlines():
            assert extension("gssmc_addon.headless.command").main(shlex.split(line)) == 0, line
