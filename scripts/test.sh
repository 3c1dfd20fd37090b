#!/usr/bin/env bash
# Make the environment, then run ruff, the rule of layers and every test; arguments go to pytest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
venv=$(./scripts/setup.sh blender,dev,lab)
"$venv/bin/ruff" check .
"$venv/bin/lint-imports"
# All of them in two processes, a file in one of the two; what is chosen by arguments in one.
(( $# )) || set -- --numprocesses=2 --dist=loadfile
exec "$venv/bin/python" -m pytest "$@"
