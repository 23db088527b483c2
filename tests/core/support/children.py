"""Children that do what a test wants of them."""

import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

from core.processes.child import Child

REPO = Path(__file__).parents[3]
HEAD = f"""
import os, sys, time
sys.path.insert(0, {str(REPO)!r})
from core.processes.requests import Requests
requests = Requests()
"""

# A worker of a batch that does what its jobs say; START is how it begins.
WORKER = """
requests.next()
START
while True:
    job, _ = requests.next()
    if job["do"] == "die":
        os._exit(7)
    if job["do"] == "cut":
        os.write(requests._answers.fileno(), b'{"n": 3, "arr')
        os._exit(0)
    if job["do"] == "hang":
        time.sleep(600)
    time.sleep(job["wait"])
    requests.answer({"n": job["n"]})
"""
WELL = WORKER.replace("START", "requests.answer({'dropped': 5})")
DIES = WORKER.replace("START", "os._exit(3)")


class Scripted(Child):
    """Runs `code`, in which `requests` are its requests."""

    def __init__(self, code):
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        command = [sys.executable, "-c", HEAD + textwrap.dedent(code)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said)

    @property
    def pid(self):
        return self._process.pid
