#!/usr/bin/env bash
# Make the Python environment of this clone, once: scripts/setup.sh [EXTRA,EXTRA...]; the extra "lab" is the laboratory.
# In .venv at the root, or in $LFSR_VENV. Prints its folder on standard output.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=${LFSR_VENV:-$root/.venv}
extras=${1:-blender}

# What the bpy wheel links against and does not bring (ldd bpy/__init__.so), with the Debian 12 packages.
libraries="libGL.so.1:libgl1 libX11.so.6:libx11-6 libXext.so.6:libxext6 libXfixes.so.3:libxfixes3
 libXi.so.6:libxi6 libXrender.so.1:libxrender1 libxkbcommon.so.0:libxkbcommon0 libSM.so.6:libsm6
 libICE.so.6:libice6"

find_python() {  # the first Python 3.11 that can make environments: the bpy wheel exists for 3.11 only
    local candidate
    for candidate in python3.11 /usr/bin/python3.11 python3; do
        if "$candidate" -c 'import sys, venv, ensurepip; ensurepip.version(); sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
}

missing_packages() {  # Debian packages whose library the loader cannot load
    local pair
    for pair in $libraries; do
        "$1" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "${pair%%:*}" 2>/dev/null || echo -n " ${pair##*:}"
    done
}

stop_for_packages() {
    echo "Missing system packages. Install them on Debian 12 with" >&2
    echo "  sudo apt-get update && sudo apt-get install -y$1" >&2
    exit 2
}

python=$(find_python)
[ -n "$python" ] || stop_for_packages " python3.11 python3.11-venv$(
    command -v python3 >/dev/null && missing_packages python3)"
case ",$extras," in *,blender,*)
    packages=$(missing_packages "$python")
    [ -z "$packages" ] || stop_for_packages "$packages" ;;
esac

# Installed once per state of the two files that say what to install.
stamp=$venv/.lfsr-$(cat "$root/pyproject.toml" "$root/scripts/lab/pyproject.toml" "$root/scripts/constraints.txt" <(echo "$extras $root") | sha256sum | cut -c1-16)
if [ ! -e "$stamp" ]; then
    echo "Making the environment in $venv (once; the Blender wheel is about 350 MB)" >&2
    [ -x "$venv/bin/python" ] || "$python" -m venv "$venv" >&2
    "$venv/bin/python" -m pip install -qq --disable-pip-version-check \
        --constraint "$root/scripts/constraints.txt" --editable "$root[${extras//,lab/}]" \
        $(case ",$extras," in *,lab,*) echo "--editable $root/scripts/lab[training]" ;; esac) >&2
    touch "$stamp"
fi
echo "$venv"
