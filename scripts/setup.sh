#!/usr/bin/env bash
# Sets up .venv from requirements.lock; does nothing when it is up to date. Run by demo.sh and test.sh.
# With --all also .venv45 and .venv53 from their own locks: Blender 4.5 LTS and 5.3, for the tests alone.
# Needs: bash, Python 3.13 and 3.11 (or uv, which brings them), and the system libraries that Blender's own module links to.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export UV_SYSTEM_CERTS="${UV_SYSTEM_CERTS:-1}"  # the machine's own certificates: many networks have one of their own

find_uv() {
  # `uv --version` and not `command -v`: a version manager's shim may exist and still refuse to run.
  if uv --version >/dev/null 2>&1; then UV=uv; return; fi
  UV=.uv/bin/uv
  "$UV" --version >/dev/null 2>&1 && return
  for python in python3.13 python3 python; do
    if "$python" -m venv .uv >/dev/null 2>&1 && .uv/bin/python -m pip install -q uv; then return; fi
  done
  echo "setup: neither uv nor a Python with venv and pip was found; install uv or Python 3.13 and run this again." >&2
  exit 2
}

# make_venv FOLDER LOCK PYTHON: without a dependency check, for the lock is complete and says what works together.
make_venv() {
  cmp -s "$2" "$1/$2" && return
  find_uv
  [ -x "$1/bin/python" ] || "$UV" venv -q --python "$3" "$1"
  "$UV" pip sync -q --python "$1/bin/python" --require-hashes "$2"
  cp "$2" "$1/$2"
}

make_venv .venv requirements.lock "$(cat .python-version)"
if [ "${1:-}" = --all ]; then
  make_venv .venv45 requirements45.lock 3.11
  make_venv .venv53 requirements53.lock 3.13
fi

# Blender's module is linked against X11 and GL even when it draws nothing.
libraries="libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libgl1 libegl1"
if ! .venv/bin/python -c "import bpy" >/dev/null 2>&1; then
  if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    apt-get update -q >/dev/null && apt-get install -y -q --no-install-recommends $libraries >/dev/null
  fi
  .venv/bin/python -c "import bpy" >/dev/null 2>&1 || {
    echo "setup: Blender's Python module cannot be loaded; install the system libraries it needs (Debian: $libraries)." >&2
    exit 2
  }
fi
