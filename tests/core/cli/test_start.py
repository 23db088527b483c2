"""What a command and the processes it starts bring into memory before they begin."""

import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[3]
# Modules of the processes that are started by the dozen.
STARTED = ("core.cli.main", "core.batch.worker", "core.render.worker")


@pytest.mark.parametrize("module", STARTED)
def test_no_part_of_scipy_is_imported_before_it_is_needed(module):
    """Each of its parts takes as long as numpy and OpenCV together."""
    look = f"import sys, {module}; print(sorted(m for m in sys.modules if m.startswith('scipy.')))"
    done = subprocess.run([sys.executable, "-c", look], cwd=REPO, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
