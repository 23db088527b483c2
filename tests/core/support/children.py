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


class Scripted(Child):
    """Runs `code`, in which `requests` are its requests."""

    def __init__(self, code):
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the process
        command = [sys.executable, "-c", HEAD + textwrap.dedent(code)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said)

    @property
    def pid(self):
        return self._process.pid
