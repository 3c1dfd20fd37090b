#!/usr/bin/env bash
# A Blender 5.2 with a window, of Debian's unstable suite, in a folder of its own: scripts/window_blender.sh DIR [COMMAND...]
# Makes DIR if it is not there (as root, with mmdebstrap; 1.2 GB, two to five minutes), then runs COMMAND inside it, which
# sees this machine's temporary folder. Software OpenGL, Python 3.14, no Open Shading Language, no Open Image Denoise.
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: $0 DIR [COMMAND...]" >&2; exit 2; }
directory=$(realpath -m "$1")
shift
# What Debian's Blender does not ask for but its extensions (requests, cattr) and our second stage need, and the tools of
# the window tests.
packages=blender,libgl1-mesa-dri,python3-numpy,python3-openimageio,python3-pyopencolorio,python3-cattr,python3-requests
tools=xvfb,xdotool,imagemagick

if [ ! -e "$directory" ]; then
    command -v mmdebstrap >/dev/null || { echo "mmdebstrap is missing: apt-get install mmdebstrap" >&2; exit 2; }
    making=$(mktemp -d "$directory.XXXXXX")
    # The mirror is mmdebstrap's own choice; a snapshot may be older than its release file allows.
    mmdebstrap --variant=apt --aptopt='Acquire::Check-Valid-Until "false"' --include="$packages,$tools" \
        sid "$making" >&2
    mv "$making" "$directory"
fi
if [ $# -eq 0 ]; then
    echo "LFSR_WINDOW_BLENDER=$directory python -m pytest -m window      runs the window tests"
    echo "$0 $directory blender                                          starts Blender on \$DISPLAY"
    exit
fi
temporary=${TMPDIR:-/tmp}
mkdir -p "$directory/$temporary"
export LIBGL_ALWAYS_SOFTWARE=1
# shellcheck disable=SC2016  # expanded inside
exec unshare --mount bash -c '
    mount --bind /proc "$0/proc" && mount --bind /dev "$0/dev" && mount --bind "$1" "$0/$1"
    cd "$0/$1" && exec chroot "$0" "${@:2}"' "$directory" "$temporary" "$@"
