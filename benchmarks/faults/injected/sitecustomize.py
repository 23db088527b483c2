"""Faults inside the processes of a trial. Python imports this file by itself when it starts, from the path of the trial; the
variable GSSMC_FAULT says in JSON what is asked for:

stub: seconds that a photo takes in place of the engine; what it answers depends on every pixel of the photo and on the scan.
killer: the name of a file at whose opening by a worker (with killer_any by any process) the process aborts.
die: the number of the writing call before which the main process kills itself; count: a file to write that number to instead.
jump: [seconds on the machine's monotonic clock, by how much time.time() is off from then on].
slow: seconds that each fsync takes.
"""

import json
import os
import signal
import sys
import time
from itertools import count

ASKED = json.loads(os.environ.get("GSSMC_FAULT", "{}"))
WORKER = any(argument.endswith(".worker") for argument in sys.orig_argv)


def stub(seconds):
    """Puts an answer that is quick to make in the place of the engine's."""
    import zlib

    import core.batch.refine_one as refining
    import core.locate as locating
    from core.geometry.camera import Camera, Intrinsics
    from core.photos.fit import fit_camera
    from core.pose.report import RefineReport

    small = Intrinsics(32, 24, 20.0, 20.0, 16.0, 12.0)

    def report(renderer, photo, start):
        view = renderer.render(small, start.pose)
        told = f"Made of {zlib.crc32(photo.pixels.tobytes())} and {zlib.crc32(view.color.tobytes())}."
        time.sleep(seconds)
        return RefineReport(start, start, "trusted", (told,), (), time.monotonic() % 100, stage="loop")

    def refine_starts(renderer, photo, starts, settings, on_progress=None):
        return report(renderer, photo, fit_camera(photo, starts[0][0]))

    def find_camera(renderer, target, landmarks, settings=None, on_progress=None):
        view = landmarks.views[0]
        made = report(renderer, target.photo, Camera(target.intrinsics, view.pose))
        total = f"{len(landmarks)} views, {zlib.crc32(view.descriptors.tobytes())}."
        return locating.FindReport(made.camera, "trusted", (*made.reasons, total), None, made, len(landmarks), made.seconds)

    refining.refine_starts, locating.find_camera = refine_starts, find_camera


def watch_opening(name):
    """Aborts where the file is opened."""

    def hook(event, arguments):
        if event == "open" and os.path.basename(os.fsdecode(arguments[0]) if not isinstance(arguments[0], int) else "") == name:
            os.abort()

    sys.addaudithook(hook)


def count_writes(call):
    """Calls `call(n)` before the n-th thing that the process does to files below the trial's folder."""
    folder, number, fsync = os.environ["GSSMC_TRIAL"], count(1), os.fsync

    def synced(handle):
        call(next(number))
        fsync(handle)

    def hook(event, arguments):
        if event in ("os.rename", "os.remove", "os.truncate") or (event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
            path = arguments[0]
            if isinstance(path, int) or str(path).startswith(folder):
                call(next(number))

    os.fsync = synced
    sys.addaudithook(hook)


def jump(at, seconds):
    for name, unit in (("time", 1), ("time_ns", 1_000_000_000)):
        real = getattr(time, name)
        setattr(time, name, lambda real=real, unit=unit: real() + (int(seconds * unit) if time.monotonic() > at else 0))


def die_at(wanted):
    def call(number):
        if number == wanted:
            os.kill(os.getpid(), signal.SIGKILL)

    return call


def keep_count(file):
    def call(number):
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.write(handle, str(number).encode())
        os.close(handle)

    return call


def slow_fsync(seconds):
    real = os.fsync

    def fsync(handle):
        time.sleep(seconds)
        real(handle)

    os.fsync = fsync


if "stub" in ASKED and WORKER:
    stub(ASKED["stub"])
if "killer" in ASKED and (WORKER or ASKED.get("killer_any")):
    watch_opening(ASKED["killer"])
if "die" in ASKED and not WORKER:
    count_writes(die_at(ASKED["die"]))
if "jump" in ASKED:
    jump(*ASKED["jump"])
if "slow" in ASKED:
    slow_fsync(ASKED["slow"])
if "count" in ASKED and not WORKER:
    count_writes(keep_count(ASKED["count"]))
