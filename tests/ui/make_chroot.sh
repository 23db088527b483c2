#!/usr/bin/env bash
# Makes the Debian in which the window tests run: Debian's own Blender, a virtual X server with software OpenGL, and for Debian's
# Python what the extension's wheels would bring. Needs root, Debian and about 2 GB; takes some minutes, once.
#   make_chroot.sh [FOLDER]     default: $GSSMC_CHROOT, or ~/.cache/gssmc-window
set -euo pipefail
folder="${1:-${GSSMC_CHROOT:-$HOME/.cache/gssmc-window}}"
if [ -x "$folder/usr/bin/blender" ]; then exit 0; fi
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
  echo "make_chroot: the window tests need root on Debian, to make a Debian of their own in $folder." >&2
  exit 2
fi
command -v mmdebstrap >/dev/null || apt-get install -y -q --no-install-recommends mmdebstrap
# Blender's newest package is in Debian's unstable suite, which the mirror that this machine uses has too.
mirror="$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' | grep '/debian/\?$' | sort -u | head -n 1)"
packages=(
  blender python3-numpy python3-cattr python3-requests python3-zstandard    # the extension system of Blender imports the last three
  xvfb libegl1 libegl-mesa0 libgl1 libglx-mesa0 libgl1-mesa-dri libgles2     # a display, and OpenGL without a graphics card
  imagemagick fonts-dejavu-core ca-certificates procps                       # screenshots; letters in them
)
mkdir -p "$(dirname "$folder")"
mmdebstrap --mode=root --variant=minbase --include="$(IFS=,; echo "${packages[*]}")" \
  --aptopt='APT::Install-Recommends "false"' --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
  unstable "$folder" "deb $mirror unstable main"
python="$(chroot "$folder" python3 -c 'import sys; print("{}.{}".format(*sys.version_info))')"
platforms=(manylinux_2_28_x86_64 manylinux_2_27_x86_64 manylinux_2_17_x86_64 manylinux2014_x86_64)
python3 -m pip install -q --no-deps --only-binary=:all: --implementation cp --python-version "$python" \
  "${platforms[@]/#/--platform=}" --target "$folder/usr/lib/python3/dist-packages" \
  opencv-contrib-python-headless==5.0.0.93 scipy==1.18.1 plyfile==1.1.5
chroot "$folder" python3 -c 'import cv2, numpy, plyfile, scipy'
