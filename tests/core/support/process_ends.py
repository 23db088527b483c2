"""Whether a process still runs, and waiting for it to end."""

import os
import time
from pathlib import Path


def alive(pid):
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    state = Path(f"/proc/{pid}/stat")  # an orphan that ended stays in the table until somebody collects it
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"


def wait_for(true, limit_s=30):
    end = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)
