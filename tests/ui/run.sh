#!/usr/bin/env bash
# All tests in a real Blender window. The first run makes a Debian for them (see make_chroot.sh). Arguments go to pytest, for
# example `-k viewport`. GSSMC_UI_SHOTS=FOLDER keeps the screenshots; GSSMC_CHROOT=FOLDER takes another Debian.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
bash scripts/setup.sh
bash tests/ui/make_chroot.sh
exec .venv/bin/python -m pytest -m window -rs tests/ui "$@"
