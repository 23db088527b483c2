"""What the engine's sentences may not hold, wherever they are made: a walk of its sources."""

import ast
import itertools
import re
from pathlib import Path

import pytest

from core.support.words import counted

REPO = Path(__file__).parents[2]
SPOKEN = sorted([*(REPO / "core").rglob("*.py"), *(REPO / "gssmc_addon").rglob("*.py"), *(REPO / "operators").glob("*.py")])
NOUNS = "cameras columns corners features Gaussians iterations landmarks matches photos poses records starts views"
PLURAL = re.compile(rf" (?:(?!of\b)\w+ )?({NOUNS.replace(' ', '|')})\b")


def name(path):
    return path.relative_to(REPO).as_posix()


def test_counted():
    assert [counted(n, "view") for n in (0, 1, 2)] == ["0 views", "1 view", "2 views"]
    assert counted(1, "match", "matches") == "1 match" and counted(5, "match", "matches") == "5 matches"


@pytest.mark.parametrize("path", [p for p in SPOKEN if p.is_relative_to(REPO / "core")], ids=name)
def test_a_number_before_a_plural_is_not_one(path):
    """A number and its noun are made by `counted`, which knows the singular."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        parts = node.values if isinstance(node, ast.JoinedStr) else []
        for value, after in itertools.pairwise(parts):
            if isinstance(value, ast.FormattedValue) and isinstance(after, ast.Constant):
                assert not PLURAL.match(after.value), f"{name(path)}:{node.lineno} {ast.unparse(node)}"


@pytest.mark.parametrize("path", [p for p in SPOKEN if p.name != "problem.py"], ids=name)
def test_no_sentence_names_a_class(path):
    """Nobody can do anything with a "(BadZipFile)". Report a Problem is for those who can."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        assert not (isinstance(node, ast.Attribute) and node.attr in ("__name__", "__qualname__")), (
            f"{name(path)}:{node.lineno}"
        )
