#!/bin/sh
# Creates a virtual environment.  usage: PYTHON=python3 make_venv.sh FOLDER
set -eu
python=${PYTHON:-python3}

if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    echo "error: $python is not Python 3.11 or newer; give one, for example: make PYTHON=python3.11" >&2
    exit 1
fi
# Debian keeps this part of the standard library in a package of its own
if ! "$python" -c 'import ensurepip' 2> /dev/null; then
    "$(dirname "$0")/apt_install.sh" :python3-venv
fi
"$python" -m venv --clear "$1"
