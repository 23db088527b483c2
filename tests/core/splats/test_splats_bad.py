"""Bad splat files: one sentence each, which says what was found, and no memory spent on what a header merely claims."""

import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ply_files import names, ply_bytes, raw_table

from core.errors import SplatFormatError
from core.splats import read_splats


def refuse(path, words):
    """Reading fails with one sentence that holds `words`."""
    with pytest.raises(SplatFormatError, match=re.escape(words)) as caught:
        read_splats(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert len(sentence) < 300
    assert sentence[0].isupper() or sentence[0] == "'"
    return sentence


def without(*dropped, count=3):
    return {name: values for name, values in raw_table(count).items() if name not in dropped}


def poisoned():
    table = raw_table(3)
    table["x"][:] = np.nan
    return table


RAW = raw_table(3)
LISTED = ply_bytes(RAW).replace(b"property float nx", b"property list uchar float nx")
CASES = {
    "empty": (b"", "is empty (0 bytes)"),
    "not a ply": (b"\x89PNG\r\n\x1a\n" + bytes(100), "is a PNG picture, not a splat file of a known format"),
    "no end of header": (b"ply\nformat ascii 1.0\nelement vertex 3\n", "no end_header line"),
    "no format": (b"ply\nelement vertex 3\nproperty float x\nend_header\n", "no format line"),
    "unknown format": (b"ply\nformat binary_middle_endian 1.0\nend_header\n", "'binary_middle_endian' is unknown"),
    "mesh": (
        ply_bytes({name: RAW[name] for name in ("x", "y", "z", "nx", "ny", "nz")}),
        "holds a mesh or plain points, no Gaussians",
    ),
    "CloudCompare": (
        ply_bytes({n if n in "xyz" else f"scalar_{n}": v for n, v in raw_table(3, 1).items()}),
        "a splat that CloudCompare saved as plain points, with its values under other names",
    ),
    "no vertices": (b"ply\nformat ascii 1.0\nelement face 1\nproperty int a\nend_header\n1\n", "mesh or plain points"),
    "compressed": (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uint packed_position\nend_header\n\0\0\0\0",
        "has no element 'chunk'",
    ),
    "no scales": (ply_bytes(without("scale_1", "scale_2")), "lacks the properties scale_1, scale_2"),
    "zero Gaussians": (ply_bytes({n: v[:0] for n, v in RAW.items()}), "holds zero Gaussians"),
    "all invalid": (ply_bytes(poisoned()), "Every Gaussian of the file (3) holds a NaN"),
    "30 f_rest": (ply_bytes(RAW | {f"f_rest_{i}": RAW["x"] for i in range(30)}), "30 f_rest values"),
    "gap in f_rest": (ply_bytes(RAW | {f"f_rest_{i}": RAW["x"] for i in range(1, 10)}), "9 f_rest values"),
    "f_rest_05": (
        ply_bytes(raw_table(3, 1)).replace(b"f_rest_5", b"f_rest_05"),
        "9 f_rest values that are not numbered 0 to 8",
    ),
    "endless f_rest": (ply_bytes(raw_table(3, 1)).replace(b"f_rest_5", b"f_rest_" + b"9" * 5000), "not numbered 0 to 8"),
    "endless count": (ply_bytes(RAW).replace(b"vertex 3", b"vertex " + b"9" * 5000), "999...' is not 'element NAME COUNT'"),
    "count beyond files": (ply_bytes(RAW, "ascii", count=10**30), "is not 'element NAME COUNT'"),
    "list in vertex": (LISTED, "vertex property 'nx' is a list"),
    "twice": (ply_bytes(RAW).replace(b"property float nx", b"property float ny"), "lists the property 'ny' twice"),
    "unknown type": (ply_bytes(RAW).replace(b"property float nx", b"property quaternion nx"), "'property quaternion nx'"),
    "bad count": (ply_bytes(RAW).replace(b"element vertex 3", b"element vertex -3"), "'element vertex -3'"),
    "property first": (b"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "property before any element"),
    "cut binary": (ply_bytes(raw_table(9))[:-70], "it holds 7 of 9 Gaussians"),
    "cut in header's promise": (ply_bytes(RAW, count=10**15), "it holds 3 of 1000000000000000 Gaussians"),
    "cut ascii": (ply_bytes(RAW, "ascii", count=5), "it holds 3 of 5 Gaussians"),
    "hostile ascii": (ply_bytes(RAW, "ascii", count=10**15), "it holds 3 of 1000000000000000 Gaussians"),
    "words in ascii": (ply_bytes(RAW, "ascii").replace(b"\n0.", b"\nzero.").replace(b"\n-0.", b"\nzero."), "numbers per line"),
    "short ascii line": (ply_bytes(RAW, "ascii")[:-30], f"{len(names())} numbers per line"),
    "cut before vertices": (
        ply_bytes(RAW, before=[(["element face 99999999999", "property list uint int v"], bytes(400))])[:700],
        "ends inside its element 'face'",
    ),
    "hostile element before": (
        ply_bytes(RAW, before=[(["element camera 999999999999999", "property double v"], b"")]),
        "ends inside its element 'camera'",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_file_gets_one_sentence(tmp_path, case):
    data, words = CASES[case]
    path = tmp_path / "scene.ply"
    path.write_bytes(data)
    refuse(path, words)


def test_missing_file_and_folder(tmp_path):
    assert "nowhere.ply" in refuse(tmp_path / "nowhere.ply", "There is no splat file")
    refuse(tmp_path, "is a folder")


def test_binary_garbage_as_header_ends_soon(tmp_path):
    path = tmp_path / "scene.ply"
    path.write_bytes(b"ply\n" + bytes(8 << 20))
    refuse(path, "no end_header line")


@pytest.mark.skipif(sys.platform == "win32", reason="resource limits are a Unix thing")
def test_hostile_count_allocates_nothing(tmp_path):
    """A header that promises 40 GB is refused by a process that may not even reserve 2 GB."""
    path = tmp_path / "scene.ply"
    path.write_bytes(ply_bytes(RAW, count=200_000_000))
    code = f"from core.splats import read_splats; read_splats({str(path)!r})"
    limit = 2 << 30
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[3],
        env={"OPENBLAS_NUM_THREADS": "1", "PATH": ""},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert "it holds 3 of 200000000 Gaussians" in done.stderr
