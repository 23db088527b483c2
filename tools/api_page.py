"""Writes docs/api.md from the engine's own signatures and docstrings.

python tools/api_page.py           writes the page
python tools/api_page.py --check   only says whether it is as the code is; exit code 1 when it is not
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
PAGE = REPO / "docs" / "api.md"
sys.path.insert(0, str(REPO))

INTRODUCTION = """# The engine from Python

Written by `tools/api_page.py` from the code; change the docstrings there, not this page.

The package `core` is plain Python with numpy, OpenCV, SciPy and plyfile, and knows no Blender. Its public names are imported
from `core` itself; everything else may move. Frames, units and pixel centres are those of
[design.md](design.md#2-frames-and-units); words are explained in [glossary.md](glossary.md). The example runs in the tests;
`folder` holds a scan, a photo and a start.

```python run
from pathlib import Path

from core import Camera, Intrinsics, Pose, Renderer, RefineSettings, read_photo, read_splats, refine

scene = read_splats(Path(folder) / "room.ply")
photo = read_photo(Path(folder) / "photo.jpg")
start = Camera(Intrinsics(photo.width, photo.height, fx, fy, cx, cy), Pose(R, t), focal_guessed=True)

report = refine(Renderer(scene), photo, start, RefineSettings(seed=1))
print(report.verdict, report.camera.pose.centre, report.camera.intrinsics.focal)
for reason in report.reasons:
    print(reason)
```

Errors are subclasses of `core.errors.GssmcError`, each with one sentence: what was found and what to do.
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare only")
    text = page()
    if parser.parse_args().check:
        if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
            print("docs/api.md is not what the code says; run: python tools/api_page.py")
            return 1
        return 0
    PAGE.write_text(text, encoding="utf-8")
    return 0


def page() -> str:
    """The whole page."""
    import core
    from core import errors
    from core.features.types import Extractor, Features, Matcher, Matches
    from core.photos.photo import Photo
    from core.pose.report import IterationRecord, PoseQuality, RefineProgress
    from core.render.view import RenderedView, ViewRenderer
    from core.splats.format import SplatFormat, SplatInfo
    from core.splats.scene import GaussianScene

    failures = [o for o in vars(errors).values() if inspect.isclass(o) and issubclass(o, errors.GssmcError)]
    parts = [
        INTRODUCTION,
        "## Public names\n",
        *(section(name, getattr(core, name)) for name in core.__all__),
        "## What they take and give\n",
        *(section(o.__name__, o) for o in (GaussianScene, Photo, RenderedView, RefineProgress, IterationRecord, PoseQuality)),
        "## Contracts for additions\n",
        "What a splat format, an extractor and a matcher offer; [CONTRIBUTING](../CONTRIBUTING.md) says where they go.\n",
        *(section(o.__name__, o) for o in (SplatFormat, SplatInfo, Extractor, Features, Matcher, Matches, ViewRenderer)),
        "## Errors\n",
        "\n".join(f"- `{o.__name__}`: {first_line(o)}" for o in failures) + "\n",
    ]
    return "\n".join(parts)


def section(name: str, thing: object) -> str:
    """A heading, the signature, and the docstring; for a class its public methods and properties too."""
    lines = [f"### {name}\n", f"```python\n{signature(name, thing)}\n```\n", plain(inspect.getdoc(thing) or "") + "\n"]
    for member, value in methods(thing):
        text = plain(first_line(value)) if inspect.getdoc(value) else ""
        lines.append(f"- `{member}{arguments(value)}`" + (f": {text}" if text else ""))
    return "\n".join(lines) + ("\n" if lines[-1].startswith("- ") else "")


def signature(name: str, thing: object) -> str:
    """`name(...)`, one parameter a line where it is long; annotations as they stand in the source."""
    if getattr(thing, "_is_protocol", False):
        return f"class {name}(Protocol)"
    found = inspect.signature(thing)  # type: ignore[arg-type]
    parts = [parameter(p) for p in found.parameters.values()]
    gives = str(found.return_annotation).strip("'")
    result = "" if found.return_annotation is found.empty or gives == "None" else f" -> {gives}"
    line = f"{name}({', '.join(parts)}){result}"
    return line if len(line) <= 100 else f"{name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){result}"


def parameter(p: inspect.Parameter) -> str:
    """`name: type = default`; a default that is made for each object stands as three dots."""
    text = p.name if p.annotation is p.empty else f"{p.name}: {str(p.annotation).strip(chr(39))}"
    if p.default is p.empty:
        return text
    return f"{text} = {'...' if 'factory' in repr(p.default) else repr(p.default)}"


def methods(thing: object) -> list[tuple[str, object]]:
    if not inspect.isclass(thing):
        return []
    own = ((n, v) for n, v in vars(thing).items() if not n.startswith("_"))
    return [(n, v) for n, v in own if isinstance(v, property | classmethod) or inspect.isfunction(v)]


def arguments(member: object) -> str:
    """The parameters of a method by name; nothing for a property."""
    if isinstance(member, property):
        return ""
    function = member.__func__ if isinstance(member, classmethod) else member
    names = list(inspect.signature(function).parameters)[1:]  # type: ignore[arg-type]
    return f"({', '.join(names)})"


def first_line(thing: object) -> str:
    return (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")


def plain(text: str) -> str:
    """A docstring as Markdown: each `name:` of a list of fields begins a line of its own."""
    return re.sub(r"(?<!\n)\n(?=(?:`?\w+`?): )", "  \n", text)


if __name__ == "__main__":
    sys.exit(main())
