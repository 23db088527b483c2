"""What the engine's conventions say is said once: half a pixel, and what a quaternion turns."""

import re
from pathlib import Path

import pytest

CORE = Path(__file__).parents[3] / "core"
ROOMS = ("features", "photos", "pictures", "pose", "render", "cameras")
HALF = re.compile(r"(?<![\w.*])\s[+-]=?\s0\.5\b(?!\s*\*)")
ALLOWED = re.compile(r"\* 255 \+ 0\.5|\(bottom \+ 0\.5\)|scene\.sh\[i\]")  # rounding to a byte's level, the grey of SH
MATRIX = re.compile(r"1 - 2 \* \((\w) \* \1 \+")


def lines(*rooms):
    for path in sorted(path for room in rooms for path in (CORE / room).rglob("*.py")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            yield f"{path.relative_to(CORE)}:{number}", line.partition("  #")[0]


@pytest.mark.parametrize("room", ROOMS)
def test_half_a_pixel_is_added_in_conventions_alone(room):
    code = [(where, line) for where, line in lines(room) if '"""' not in line and not line.strip().startswith("#")]
    found = [(where, line.strip()) for where, line in code if HALF.search(line) and not ALLOWED.search(line)]
    prose = re.compile(r"^[A-Z`a-z].*[a-z,.;]$")
    assert [item for item in found if not prose.match(item[1])] == []


def test_one_function_makes_matrices_of_quaternions():
    found = [where for where, line in lines(".") if MATRIX.search(line)]
    assert {where.split(":")[0] for where in found} == {"geometry/quaternion.py"}
