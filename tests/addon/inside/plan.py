"""Which checks run in which Blender: the one place that says so.

Blender 5.2 LTS, the one in .venv, runs every check that fits it. The others run all but LONGEST, which say the same in every
Blender, so that the whole run stays under a quarter of an hour on two cores; check_operators sees to it that each Blender still
calls every operator at least once. Single tests that are long are marked main_only and run in MAIN alone. A check of what
only newer Blenders have stands in SINCE.

In MAIN each check has a Blender of its own, so that a crash fails one check. In the others several share one, which saves its
start; those in ALONE, which end it or the extension, do not.
"""

from pathlib import Path

MAIN = (5, 2)
BLENDERS = ((4, 5), MAIN, (5, 3))
LONGEST = (
    "check_docs",
    "check_find",
    "check_fox",
    "check_photos",
    "check_pins",
    "check_preview",
    "check_proxy",
    "check_refine",
    "check_render_gpu",
    "check_sequence",
    "check_texts",
)
LONGEST += ("check_who_draws",)
SINCE = {"check_native": (5, 3)}  # splats of Blender's own

ALONE = ("check_jobs", "check_lifecycle", "check_native", "check_preferences", "check_viewport")
SHARED = 3  # Blenders that the other checks share

ALL = sorted(Path(__file__).parent.glob("check_*.py"))


def checks(blender):
    """Files of the checks that run in the Blender of that (major, minor) version."""
    spared = LONGEST if blender != MAIN else ()
    return [check for check in ALL if check.stem not in spared and SINCE.get(check.stem, blender) <= blender]


def runs(blender):
    """The names and files of the checks that share a process, for each process in that Blender."""
    files = checks(blender)
    if blender == MAIN:
        return [(check.stem, [check]) for check in files]
    others = [check for check in files if check.stem not in ALONE]
    shared = [(f"checks_{n + 1}", others[n::SHARED]) for n in range(SHARED)]
    return [(check.stem, [check]) for check in files if check.stem in ALONE] + shared
