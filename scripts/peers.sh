#!/usr/bin/env bash
# Makes a folder with the Python wheels that benches/speed_vs_error measures beside tumble: scripts/peers.sh FOLDER; then
# cargo bench --bench speed_vs_error --features box3d -- --python FOLDER/bin/python
set -euo pipefail
if [ $# -ne 1 ]; then
    echo "usage: scripts/peers.sh FOLDER" >&2
    exit 2
fi
python3 -m venv "$1"
"$1/bin/pip" install --quiet dimforge-nexus3d==0.3.0 mujoco==4.0.0 numpy
"$1/bin/python" -c 'import mujoco, nexus3d, numpy; print("ready:", "mujoco", mujoco.__version__, "and nexus")'
