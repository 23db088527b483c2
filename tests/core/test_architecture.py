"""The house rules that a reader cannot be asked to check by eye: who imports whom, and who may print."""

import ast
from functools import cache
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
BLENDER = {"bpy", "bpy_extras", "bmesh", "gpu", "gpu_extras", "mathutils", "bl_ui", "addon_utils", "blf", "aud", "idprop"}
FARM = {"distributed"}  # an extra, for the executor of that name alone
ALLOWED = {"numpy", "cv2", "scipy", "plyfile", "zstandard", "pxr"}  # what the extension's wheels and Blender itself bring
CORE = sorted((REPO / "core").rglob("*.py"))
BLENDER_SIDE = sorted([*(REPO / "gssmc_addon").rglob("*.py"), *(REPO / "operators").rglob("*.py"), REPO / "__init__.py"])


def name(path):
    return path.relative_to(REPO).as_posix()


@cache
def nodes(path):
    """All nodes of a file's syntax tree, which every rule goes through."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imports(path):
    """(level, dotted module, names) of every import statement, wherever it stands in the file."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name, []) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or "", [alias.name for alias in node.names]


def reached(path, level, module, names):
    """Folders below the repository that a relative import leads to, such as {"core/pose"}."""
    base = path.parent
    for _ in range(level - 1):
        base = base.parent
    target = base.joinpath(*module.split(".")) if module else base
    return {target} if module else {target / n for n in names}


def test_the_walk_finds_the_engine():
    assert len(CORE) > 30
    assert len(BLENDER_SIDE) > 10


@pytest.mark.parametrize("path", CORE, ids=name)
def test_core_imports_the_engine_and_its_libraries_alone(path):
    import sys

    for level, module, names in imports(path):
        if level:
            for target in reached(path, level, module, names):
                assert target.is_relative_to(REPO / "core"), f"{name(path)} reaches {target}"
        else:
            top = module.split(".")[0]
            assert top not in BLENDER, f"{name(path)} imports {module}"
            more = FARM if path.name in ("dask_pool.py", "dask_worker.py") else set()
            assert top in ALLOWED | more | set(sys.stdlib_module_names), f"{name(path)} imports {module}"


@pytest.mark.parametrize("path", CORE, ids=name)
def test_core_loads_nothing_of_blender_by_name(path):
    """importlib and __import__ take strings, which an import statement's walk does not see."""
    for node in nodes(path):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("__import__", "importlib.import_module", "import_module"):
            assert not any(isinstance(a, ast.Constant) and str(a.value).split(".")[0] in BLENDER for a in node.args)


@pytest.mark.parametrize("path", CORE, ids=name)
def test_the_engine_prints_nowhere(path):
    """The command line speaks through core/cli/console.py, everything else logs."""
    calls = [n for n in nodes(path) if isinstance(n, ast.Call)]
    assert not [c.lineno for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]


@pytest.mark.parametrize("path", BLENDER_SIDE, ids=name)
def test_the_blender_side_imports_relatively(path):
    """Inside Blender the packages have other names, so an absolute import of our own would find nothing, or another's."""
    own = {"core", "gssmc_addon", "operators"}
    assert not [module for level, module, _ in imports(path) if level == 0 and module.split(".")[0] in own]


@pytest.mark.parametrize("path", [p for p in BLENDER_SIDE if p.parent.name == "gssmc_addon"], ids=name)
def test_the_addon_does_not_know_the_operators(path):
    if path.name == "__init__.py":  # registers them
        return
    for level, module, names in imports(path):
        if level:
            for target in reached(path, level, module, names):
                assert not target.is_relative_to(REPO / "operators"), f"{name(path)} reaches {target}"


@pytest.mark.parametrize("path", [*CORE, *BLENDER_SIDE], ids=name)
def test_modules_stay_under_300_lines_and_functions_under_40(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") < 300
    for node in nodes(path):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = (node.end_lineno or 0) - body[0].lineno + 1 if body else 0
            assert lines <= 40, f"{name(path)}:{node.lineno} {node.name} has {lines} lines"


# Lower rooms never import from higher ones; rooms of one rank do not know each other.
RANKS = (
    ("errors",),
    ("support", "geometry"),
    ("processes", "photos", "splats", "features"),
    ("cameras", "render"),
    ("pose", "proxy"),
    ("locate",),
    ("pictures", "batch", "track"),
    ("synthetic",),
    ("cli",),
)
RANK = {room: rank for rank, rooms in enumerate(RANKS) for room in rooms}
PEERS = {("geometry", "support"), ("features", "processes"), ("render", "processes")}


def room_of(path):
    return path.relative_to(REPO / "core").parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", [p for p in CORE if p.parent != REPO / "core" or p.name == "errors.py"], ids=name)
def test_arrows_point_downwards(path):
    for level, module, names in imports(path):
        if level:
            for target in reached(path, level, module, names):
                here, there = room_of(path), room_of(target)
                assert here == there or RANK[there] < RANK[here] or (here, there) in PEERS, (
                    f"{name(path)} reaches up to {there}"
                )


def graph_of(files):
    """Module name to the modules that it imports, for every import statement, wherever it stands in the file."""
    known = {dotted(p): p for p in files}
    graph = {}
    for module, path in known.items():
        graph[module] = set()
        for level, target, names in imports(path):
            if level:
                for folder in reached(path, level, target, names):
                    graph[module] |= {d for d in (dotted(folder), *(f"{dotted(folder)}.{n}" for n in names)) if d in known}
    return graph


def dotted(path):
    parts = path.relative_to(REPO).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_no_module_imports_itself_in_a_circle():
    graph, done = graph_of([*CORE, *BLENDER_SIDE]), set()

    def visit(module, trail):
        assert module not in trail, " -> ".join([*trail[trail.index(module) :], module])
        if module not in done:
            for target in sorted(graph[module] - {module}):
                visit(target, [*trail, module])
            done.add(module)

    for module in graph:
        visit(module, [])


def test_folders_stay_under_sixteen_modules():
    folders = {p.parent for p in [*CORE, *BLENDER_SIDE] if p.parent != REPO / "operators"}
    crowded = {name(f): n for f in folders if (n := len([p for p in f.glob("*.py") if p.name != "__init__.py"])) > 15}
    assert not crowded


def definitions(kind):
    """(path, node) of every class or function of the engine and the Blender side."""
    for path in [*CORE, *BLENDER_SIDE]:
        for node in nodes(path):
            if isinstance(node, kind):
                yield path, node


def test_functions_take_at_most_five_parameters():
    """More of them belong together in a frozen dataclass. Blender calls draw_item with the eight that it has."""
    crowded = []
    for path, node in definitions(ast.FunctionDef | ast.AsyncFunctionDef):
        arguments = node.args
        names = [a.arg for a in arguments.posonlyargs + arguments.args + arguments.kwonlyargs if a.arg not in ("self", "cls")]
        if len(names) > 5 and node.name != "draw_item":
            crowded.append(f"{name(path)}:{node.lineno} {node.name} takes {len(names)}")
    assert not crowded


def test_no_two_classes_share_a_name():
    """A name in a traceback or a search then leads to one class."""
    places = {}
    for path, node in definitions(ast.ClassDef):
        places.setdefault(node.name, []).append(name(path))
    assert not {word: found for word, found in places.items() if len(found) > 1}
