"""The examples of docs/, run as they stand; and the sentences of docs/troubleshooting.md, looked for in the code."""

import ast
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


def test_quoted_sentences_are_those_of_the_code():
    """Each sentence between backticks of a table, with ... for its values, must stand in some module."""
    sources = "\n".join(strings(p) for d in ("core", "gssmc_addon", "operators") for p in (REPO / d).rglob("*.py"))
    page = (REPO / "docs" / "troubleshooting.md").read_text()
    quoted = re.findall(r"^\| `(.+?)` \|", page, re.MULTILINE)
    assert len(quoted) > 25
    # the code puts sentences together from such pieces
    pieces = [piece.strip() for sentence in quoted for piece in re.split(r"\.\.\.|; |\) ", sentence) if len(piece.strip()) > 12]
    assert [piece for piece in pieces if piece not in sources] == []


def strings(path):
    """All text of a module, values of f-strings left out."""
    tree = ast.parse(path.read_text())
    return "\n".join(n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str))
