#!/usr/bin/env bash
# The main job on the built-in sample, through Blender itself: writes demo/sample.blend and demo/before_after.png.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash scripts/setup.sh
exec .venv/bin/python scripts/blender_demo.py --out demo "$@"
