#!/usr/bin/env bash
# Make a Python for Windows in DIR, and DIR/python, which runs it under Wine: scripts/windows_python.sh DIR
#
# For tests/test_wine.py. Needs Debian's wine, wine64 and gcc-mingw-w64-x86-64-win32, Python 3.11 and 3 GB. Python's
# library comes from Panda3D's wheel, which ships it for programs made with it; its modules are this Python's own.
set -euo pipefail
folder=$(mkdir -p "${1:?give a folder}" && cd "$1" && pwd)
python=${PYTHON:-python3.11}
get() { "$python" -m pip download -q --no-deps --only-binary=:all: --platform win_amd64 --python-version 3.11 -d "$folder/wheels" "$@"; }

get panda3d==1.10.16 numpy==1.26.4 openimageio==3.0.21.0 opencolorio==2.6.0 pyoidn==2.5.1.0 flip-evaluator==1.7 \
    threadpoolctl bpy==5.0.1 pytest pluggy iniconfig packaging colorama pygments hypothesis sortedcontainers
mkdir -p "$folder/py/DLLs" "$folder/packages"
unzip -qjo "$folder"/wheels/panda3d*.whl 'deploy_libs/*' -x '*/api-ms-*' '*/tcl*' '*/tk*' -d "$folder/py"
mv "$folder"/py/*.pyd "$folder/py/DLLs/"
mv "$folder"/py/{libffi,libcrypto,libssl}-*.dll "$folder/py/sqlite3.dll" "$folder/py/DLLs/"
rm "$folder"/wheels/panda3d*.whl
for wheel in "$folder"/wheels/*.whl; do unzip -qo "$wheel" -d "$folder/packages"; done
cp -r "$("$python" -c 'import sysconfig; print(sysconfig.get_path("stdlib"))')" "$folder/py/Lib"
rm -rf "$folder"/py/Lib/{site-packages,test,lib-dynload} "$folder/wheels"

x86_64-w64-mingw32-gcc -municode -x c -o "$folder/py/python.exe" - <<'C'
#include <windows.h>
int wmain(int argc, wchar_t **argv) {
    HMODULE library = LoadLibraryW(L"python311.dll");
    return library ? ((int (*)(int, wchar_t **))GetProcAddress(library, "Py_Main"))(argc, argv) : 120;
}
C
cat > "$folder/python" <<'SH'
#!/usr/bin/env bash
# Arguments go to Python; WINDOWS_PYTHONPATH is its PYTHONPATH, in this system's form.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export WINEPREFIX=$here/prefix WINEDEBUG=-all DISPLAY='' PYTHONPATH="Z:$here/packages;Z:${WINDOWS_PYTHONPATH:-}"
exec wine "$here/py/python.exe" "$@"
SH
chmod +x "$folder/python"
"$folder/python" -c 'import sys; print(sys.version)' < /dev/null 2>&1 | cat  # Wine gives Python no file for its output
