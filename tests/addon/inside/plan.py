"""Which checks run in which Blender: the one place that says so.

Blender 5.2 LTS, the one in .venv, runs every check that fits it. The others run all but LONGEST, which say the same in every
Blender, so that the whole run stays under a quarter of an hour on two cores; check_operators sees to it that each Blender still
calls every operator at least once. Single tests that are long are marked main_only and run in MAIN alone. A check of what
only newer Blenders have stands in SINCE.
"""

from pathlib import Path

MAIN = (5, 2)
BLENDERS = ((4, 5), MAIN, (5, 3))
LONGEST = (
    "check_composite",
    "check_docs",
    "check_fox",
    "check_photos",
    "check_pins",
    "check_preview",
    "check_proxy",
    "check_refine",
    "check_sample",
    "check_texts",
)
LONGEST += ("check_who_draws",)
SINCE = {"check_native": (5, 3)}  # splats of Blender's own

ALL = sorted(Path(__file__).parent.glob("check_*.py"))


def checks(blender):
    """Files of the checks that run in the Blender of that (major, minor) version."""
    spared = LONGEST if blender != MAIN else ()
    return [check for check in ALL if check.stem not in spared and SINCE.get(check.stem, blender) <= blender]
