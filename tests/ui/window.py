"""A Blender with a window, in the Debian that make_chroot.sh makes: a virtual X server and one script inside, to its end."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path

HERE = Path(__file__).parent
CHROOT = Path(os.environ.get("GSSMC_CHROOT", Path.home() / ".cache" / "gssmc-window"))
SIZE = (1600, 1000)
FIRST_DISPLAY, DISPLAYS = 200, 600
START_S, LIMIT_S = 60, 900  # for the X server, and for a script: software OpenGL on two cores is slow


class WindowError(Exception):
    """The script failed, or Blender ended without a word."""


def missing():
    """Why no window can be had here; "" when it can."""
    if not (CHROOT / "usr" / "bin" / "blender").exists():
        return f"there is no Debian with Blender in {CHROOT}; run tests/ui/make_chroot.sh as root"
    return "" if os.geteuid() == 0 else "a chroot needs root"


class Job:
    """A folder in the chroot, `path` outside and `inside` for what runs there, that goes with the job."""

    def __init__(self, name):
        self.inside = f"/gssmc-window.{os.getpid()}.{name}"
        self.path = CHROOT / self.inside[1:]
        self.path.mkdir()
        self.display = FIRST_DISPLAY + (os.getpid() + hash(name)) % DISPLAYS

    def command(self, *words):
        """Those words as a command line that runs inside, with an environment of its own."""
        environment = {
            "HOME": "/root",
            "PATH": "/usr/bin:/bin",
            "LANG": "C.UTF-8",
            "DISPLAY": f":{self.display}",
            "XDG_RUNTIME_DIR": self.inside,
            "BLENDER_USER_RESOURCES": f"{self.inside}/blender",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "GSSMC_UI": self.inside,
        }
        return ["chroot", str(CHROOT), "env", "-i", *(f"{k}={v}" for k, v in environment.items()), *words]

    @contextmanager
    def running(self, log, *words):
        """A process inside whose output goes to the file `log`; it and its children have ended afterwards."""
        with open(self.path / log, "wb") as out:
            process = subprocess.Popen(self.command(*words), stdout=out, stderr=out, start_new_session=True)
        try:
            yield process
        finally:
            for end in (signal.SIGTERM, signal.SIGKILL):
                if process.poll() is None:
                    os.killpg(process.pid, end)
                    try:
                        process.wait(10)
                    except subprocess.TimeoutExpired:
                        continue

    def drop(self):
        shutil.rmtree(self.path, ignore_errors=True)


def run(script, archive, files, shots=None):
    """Runs `script` in a new window with the extension `archive` installed and copies of `files` beside it.

    Screenshots go to the folder `shots`, if given. What the script printed is returned. Raises WindowError.
    """
    job = Job(script.stem)
    try:
        for source in (script, HERE / "driver.py", *files):
            (shutil.copytree if source.is_dir() else shutil.copy)(source, job.path / source.name)
        shutil.copy(archive, job.path / "extension.zip")
        mount_proc()
        install = ["blender", "-b", "--command", "extension", "install-file", "-r", "user_default", "--enable"]
        done = subprocess.run(job.command(*install, f"{job.inside}/extension.zip"), capture_output=True, text=True, check=False)
        if done.returncode:
            raise WindowError(f"The extension could not be installed:\n{done.stdout}{done.stderr}")
        with job.running("x.log", "Xvfb", f":{job.display}", "-screen", "0", "{}x{}x24".format(*SIZE), "-nolisten", "tcp") as x:
            wait_for(CHROOT / "tmp" / ".X11-unix" / f"X{job.display}", x)
            return drive(job, script)
    finally:
        if shots:
            shots.mkdir(parents=True, exist_ok=True)
            for picture in sorted(job.path.glob("*.png")):
                shutil.copy(picture, shots / f"{script.stem}-{picture.name}")
        job.drop()


def drive(job, script):
    options = ["--gpu-backend", "opengl", "--enable-event-simulate", "--window-geometry", "0", "0", *map(str, SIZE)]
    command = ["blender", *options, "--python", f"{job.inside}/driver.py", "--", script.name]
    with job.running("blender.log", *command) as blender, suppress(subprocess.TimeoutExpired):
        blender.wait(LIMIT_S)
    said = (job.path / "blender.log").read_text(errors="replace")
    result = job.path / "result.txt"
    if not result.exists():
        raise WindowError(f"Blender ended, or did not end, without a result:\n{said[-4000:]}")
    if error := result.read_text():
        raise WindowError(f"{error}\n{said[-4000:]}")
    return said


def wait_for(socket, process):
    end = time.monotonic() + START_S
    while not socket.exists():
        if process.poll() is not None or time.monotonic() > end:
            raise WindowError("The virtual X server did not start.")
        time.sleep(0.1)


def mount_proc():
    if not (CHROOT / "proc" / "self").exists():
        subprocess.run(["mount", "-t", "proc", "proc", str(CHROOT / "proc")], check=True)
