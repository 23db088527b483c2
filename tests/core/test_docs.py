"""The documents: every link leads somewhere, the map names every folder, and no comment points outside the repository."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
PAGES = sorted([*REPO.glob("*.md"), *(REPO / "docs").glob("*.md"), *(REPO / "benchmarks").glob("*.md")])
DESIGN = (REPO / "docs" / "design.md").read_text(encoding="utf-8")
SOURCES = [p for top in ("core", "gssmc_addon", "operators", "tools", "scripts") for p in sorted((REPO / top).rglob("*.py"))]


def anchors(page):
    """The names by which a page's headings are linked to."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(REPO).as_posix())
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        found = (page.parent / name).resolve() if name else page
        assert found.exists(), f"{page.name}: {target}"
        assert found.is_relative_to(REPO), f"{page.name}: {target} lies outside the repository"
        if anchor:
            assert anchor in anchors(found), f"{page.name}: {target}"


@pytest.mark.parametrize("top", ["core", "gssmc_addon"])
def test_the_map_names_every_folder(top):
    folders = {p.parent.relative_to(REPO / top).parts[0] for p in (REPO / top).glob("*/__init__.py")}
    missing = [name for name in sorted(folders) if f"`{name}/`" not in DESIGN]
    assert missing == [], "docs/design.md, section 1, does not name these folders"


def test_the_map_names_files_that_are_there():
    """What stands between backticks and looks like a path from the top of the repository."""
    paths = re.findall(r"`((?:core|tests|tools|benchmarks|gssmc_addon|operators|docs)/[\w/.]+)`", DESIGN)
    assert len(paths) > 5
    assert [path for path in paths if not (REPO / path).exists()] == []


def test_comments_point_to_sections_that_exist():
    sections = set(re.findall(r"^## (\d+)\.", DESIGN, re.MULTILINE))
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\((?:DESIGN|PLATFORM|STYLE)\b", text), f"{path.name} points at a document that is not here"
        for number in re.findall(r"docs/design\.md, section (\d+)", text):
            assert number in sections, f"{path.name}: section {number}"


def test_every_ring_of_the_design_is_a_marker():
    listed = set(re.findall(r"`(\w+)`", DESIGN.partition("## 6.")[2].partition("All but")[0]))
    config = (REPO / "pyproject.toml").read_text(encoding="utf-8")
    markers = set(re.findall(r'^  "(\w+): ', config.partition("markers = [")[2].partition("]\n")[0], re.MULTILINE))
    assert listed == markers - {"scan", "main_only", "asked"}, "these say more of a test than its ring"


def test_no_registry_and_no_machine_is_named():
    """Locks, workflows and scripts work wherever the packages come from."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=REPO, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    names = [n for n in listed.stdout.split("\0") if n.endswith((".lock", ".in", ".yml", ".yaml", ".sh", ".toml", ".py"))]
    hosts = re.compile("|".join(("pypi" + r"\.org", "python" + "hosted", "--" + "index-url", "--extra-" + "index-url")))
    assert [n for n in names if (REPO / n).is_file() and hosts.search((REPO / n).read_text(encoding="utf-8"))] == []


def test_quoted_sentences_are_those_of_the_code():
    """Each sentence between backticks of a table, with ... for its values, must stand in some module."""
    sources = "\n".join(strings(path) for path in SOURCES)
    page = (REPO / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    quoted = re.findall(r"^\| `(.+?)` \|", page, re.MULTILINE)
    assert len(quoted) > 25
    # the code puts sentences together from such pieces, and their full stop may stand elsewhere
    pieces = [piece.strip().rstrip(".") for sentence in quoted for piece in re.split(r"\.\.\.|; |\) ", sentence)]
    assert [piece for piece in pieces if len(piece) > 12 and piece not in sources] == []


def strings(path):
    """All text of a module, values of f-strings left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return "\n".join(n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str))
