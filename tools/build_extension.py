"""Builds the extension's zip files with Blender's own builder.

python tools/build_extension.py                 one zip per platform in dist/, for every Blender: wheels for three Pythons
python tools/build_extension.py --blender 5.2   one zip per platform for that Blender line alone, a third smaller
python tools/build_extension.py --no-wheels     one small zip for a Blender whose Python has them already (tests)
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
SHIPPED = ("blender_manifest.toml", "__init__.py", "LICENSE", "gssmc_addon", "operators", "core")
PLATFORM_TAGS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": tuple(f"macosx_{version}_arm64" for version in ("14_0", "13_0", "12_0", "11_0")),
}
# numpy is Blender's own and never in the zip. scipy's wheels are tied to one Python each: 3.11 is Blender 4.5 and 5.0,
# 3.13 is Blender 5.1 to 5.3, 3.14 is what some distributions build Blender with.
WHEELS = (
    ("scipy==1.17.1", "3.11"),
    ("scipy==1.18.1", "3.13"),
    ("scipy==1.18.1", "3.14"),
    ("opencv-contrib-python-headless==5.0.0.93", "3.11"),
    ("plyfile==1.1.5", "3.11"),
)


@dataclass(frozen=True)
class Line:
    """Blenders that a zip is for: the Pythons whose wheels it holds, and the versions at which it begins and no longer fits."""

    pythons: tuple[str, ...] = ("3.11", "3.13", "3.14")
    first: str = "4.5.0"
    beyond: str = ""

    @property
    def wheels(self) -> tuple[tuple[str, str], ...]:
        """Requirements with a Python that they are for; those of every Python stand beside 3.11 in WHEELS."""
        own = tuple(w for w in WHEELS if not w[0].startswith("scipy=="))
        return tuple(w for w in WHEELS if w not in own and w[1] in self.pythons) + own


LINES = {
    "4.5": Line(("3.11",), "4.5.0", "5.1.0"),
    "5.2": Line(("3.13",), "5.1.0", "5.3.0"),
    "5.3": Line(("3.13",), "5.3.0"),
}


def main() -> int:
    options = parse_arguments()
    builder = find_builder(options.bpy)
    options.out.mkdir(parents=True, exist_ok=True)
    line = LINES.get(options.blender, Line())
    with tempfile.TemporaryDirectory() as folder:
        stage, built = Path(folder) / "gssmc", Path(folder) / "built"
        built.mkdir()
        copy_sources(stage)
        set_versions(stage / "blender_manifest.toml", line)
        if not options.no_wheels:
            fetch_wheels(options.platforms, options.wheels, line)
            list_wheels(stage, options, line)
        command = [sys.executable, str(builder), "build", "--source-dir", str(stage), "--output-dir", str(built)]
        subprocess.run(command + ([] if options.no_wheels else ["--split-platforms"]), check=True)
        for made in sorted(built.glob("gssmc-*.zip")):
            archive = options.out / archive_name(made.name, options.blender)
            shutil.move(made, archive)
            check_archive(builder, archive)
            if not options.no_wheels:
                check_wheels(archive, line)
            print(f"{archive}  {archive.stat().st_size / 1e6:.1f} MB")
    return 0


def archive_name(built: str, blender: str | None) -> str:
    """gssmc-1.2.3-linux_x64.zip as gssmc-1.2.3-blender5.2-linux_x64.zip, where it is for one Blender line."""
    return re.sub(r"^(gssmc-[^-]+?)(-|(?=\.zip$))", rf"\1-blender{blender}\2", built) if blender else built


def set_versions(manifest: Path, line: Line) -> None:
    """Writes into the staged manifest which Blenders the zip is for."""
    said = f'blender_version_min = "{line.first}"' + (f'\nblender_version_max = "{line.beyond}"' if line.beyond else "")
    text, count = re.subn(r"^blender_version_min = .*$", said, manifest.read_text(), flags=re.MULTILINE)
    if count != 1:
        sys.exit("blender_manifest.toml must hold one line blender_version_min = ...")
    manifest.write_text(text)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=REPO / "dist", help="folder for the zip files (dist)")
    parser.add_argument(
        "--wheels", type=Path, default=REPO / "wheels", help="folder in which downloaded wheels are kept (wheels)"
    )
    parser.add_argument("--blender", choices=LINES, help="build for this Blender line alone (default: for all of them)")
    parser.add_argument("--no-wheels", action="store_true", help="one zip without wheels")
    parser.add_argument("--platforms", nargs="+", choices=PLATFORM_TAGS, default=list(PLATFORM_TAGS), help="default: all")
    parser.add_argument("--bpy", type=Path, help="folder of the bpy package; default: the one this Python would import")
    return parser.parse_args()


def find_builder(package: Path | None) -> Path:
    """The path of blender_ext.py, which ships with bpy and needs no Blender to run."""
    if package is None:
        spec = importlib.util.find_spec("bpy")
        if spec is None or spec.origin is None:
            sys.exit("The builder is part of bpy, which this Python lacks; run it with .venv/bin/python or give --bpy.")
        package = Path(spec.origin).parent
    found = sorted(package.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        sys.exit(f"{package} holds no Blender extension builder; give the folder of the bpy package with --bpy.")
    return found[-1]


def check_archive(builder: Path, archive: Path) -> None:
    """Ends the program when Blender would refuse the zip, or when it brings a numpy beside Blender's own."""
    subprocess.run([sys.executable, str(builder), "validate", str(archive)], check=True)
    with zipfile.ZipFile(archive) as content:
        numpy = [name for name in content.namelist() if Path(name).name.lower().startswith("numpy-")]
    if numpy:
        sys.exit(f"{archive} holds {numpy[0]}; numpy is Blender's own and must not be bundled.")


def check_wheels(archive: Path, line: Line) -> None:
    """Ends the program when a platform's zip lacks what one of its Pythons needs, or holds what only others can load."""
    platform = next(p for p in PLATFORM_TAGS if p.replace("-", "_") in archive.name)
    with zipfile.ZipFile(archive) as content:
        wheels = [Path(name).name for name in content.namelist() if name.endswith(".whl")]
    for requirement, python in line.wheels:
        if not any(fulfils(name, requirement, python) for name in wheels):
            sys.exit(f"{archive} holds no {requirement} for Python {python}; delete the folder of wheels and build again.")
    for name in wheels:
        if not name.endswith(("none-any.whl", *(f"{tag}.whl" for tag in PLATFORM_TAGS[platform]))):
            sys.exit(f"{archive} holds {name}, which {platform} cannot load.")


def copy_sources(stage: Path) -> None:
    stage.mkdir()
    for name in SHIPPED:
        source = REPO / name
        if source.is_dir():
            shutil.copytree(source, stage / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, stage / name)


def fetch_wheels(platforms: list[str], folder: Path, line: Line) -> None:
    """Downloads the wheels that `folder` lacks, each by its exact version, none with its dependencies."""
    for platform in platforms:
        target = folder / platform
        target.mkdir(parents=True, exist_ok=True)
        for requirement, python in line.wheels:
            if not matching(target, requirement, python):
                download(requirement, python, PLATFORM_TAGS[platform], target)


def matching(folder: Path, requirement: str, python: str) -> list[Path]:
    """The wheels in `folder` that fulfil `requirement` for that Python."""
    return [wheel for wheel in folder.glob("*.whl") if fulfils(wheel.name, requirement, python)]


def fulfils(wheel: str, requirement: str, python: str) -> bool:
    """Whether a wheel of that file name is what `requirement` asks for, and loads in that Python."""
    name, version = requirement.split("==")
    fits = any(tag in wheel for tag in (f"-cp{python.replace('.', '')}-", "abi3", "-none-any"))
    return fits and wheel.startswith(f"{name.replace('-', '_')}-{version}-")


def download(requirement: str, python: str, tags: tuple[str, ...], target: Path) -> None:
    own_uv = REPO / ".uv" / "bin" / "uv"  # where setup.sh puts it when the machine has none
    uv = str(own_uv) if own_uv.exists() else "uv"
    has_pip = importlib.util.find_spec("pip") is not None
    pip = [sys.executable, "-m", "pip"] if has_pip else [uv, "run", "--no-project", "--with", "pip", "pip"]
    command = [
        *pip,
        "download",
        "--quiet",
        "--no-deps",
        "--only-binary=:all:",
        "--implementation",
        "cp",
        "--python-version",
        python,
    ]
    for tag in tags:
        command += ["--platform", tag]
    subprocess.run([*command, "--dest", str(target), requirement], check=True)


def list_wheels(stage: Path, options: argparse.Namespace, line: Line) -> None:
    """Copies the wheels to the stage and names them in its manifest; the one in git stays without."""
    (stage / "wheels").mkdir()
    names = set()
    for platform in options.platforms:
        for requirement, python in line.wheels:
            for wheel in matching(options.wheels / platform, requirement, python):
                shutil.copy2(wheel, stage / "wheels")
                names.add(wheel.name)
    manifest = stage / "blender_manifest.toml"
    lines = "".join(f'  "./wheels/{name}",\n' for name in sorted(names))
    text, count = re.subn(r"^wheels = \[\]$", f"wheels = [\n{lines}]", manifest.read_text(), flags=re.MULTILINE)
    if count != 1:
        sys.exit('blender_manifest.toml must hold the line "wheels = []" once, for the list of wheels to go in.')
    wanted = ", ".join(f'"{p}"' for p in options.platforms)
    text = re.sub(r"^platforms = .*$", f"platforms = [{wanted}]", text, flags=re.MULTILINE)
    manifest.write_text(text)


if __name__ == "__main__":
    sys.exit(main())
