"""Which executor a batch takes, and that nobody loads Dask who did not ask for it."""

import ast
import sys
from pathlib import Path

import pytest

from core.batch.executors import Executor
from core.errors import UsageError

pytestmark = pytest.mark.unit
REPO = Path(__file__).parents[3]


def test_dask_is_loaded_only_when_it_is_asked_for():
    """One function alone leads to the modules that import it."""
    leading = []
    for path in sorted((REPO / "core").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        inside = {id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for n in ast.walk(f)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and "dask_" in f"{node.module} {[a.name for a in node.names]}":
                leading.append((path.name, id(node) in inside))
    assert [one for one in leading if not one[0].startswith("dask_")] == [("executors.py", True)]


def test_where_dask_is_missing_one_sentence_says_how_to_get_it(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("core.batch.farm.dask_")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        UsageError, match=r"needs the package distributed .*'pip install distributed', here and on the workers\.$"
    ):
        Executor(2, "dask").check()


def test_a_scheduler_without_dask_is_refused():
    with pytest.raises(UsageError, match="--scheduler goes with --executor dask"):
        Executor(2, "local", "tcp://host:8786").check()
    Executor(2).check()


def test_inside_blender_dask_is_refused(monkeypatch):
    monkeypatch.setattr("core.batch.executors.__package__", "bl_ext.user_default.gssmc.core.batch")
    with pytest.raises(UsageError, match="in Blender take --shard"):
        Executor(2, "dask").check()
