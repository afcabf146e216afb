#!/bin/sh
# Makes sure that commands and libraries exist, from Debian packages where they do not.
# usage: apt_install.sh NAME:PACKAGE...      a NAME with `.so` is a library; an empty NAME: the package is missing for another reason
set -eu

exists() {
    case $1 in
    '') return 1 ;;
    *.so*) "${PYTHON:-python3}" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1" 2> /dev/null ;;
    *) command -v "$1" > /dev/null ;;
    esac
}

missing=
for pair in "$@"; do
    exists "${pair%%:*}" || missing="$missing ${pair#*:}"
done
[ -n "$missing" ] || exit 0

if ! command -v apt-get > /dev/null; then
    echo "error: missing, by the names of Debian's packages:$missing; install them and run make again" >&2
    exit 1
fi
if [ "$(id -u)" -ne 0 ]; then
    echo 'error: packages are missing and only root can install them; run this and then make again:' >&2
    echo "    sudo apt-get update && sudo apt-get install --no-install-recommends$missing" >&2
    exit 1
fi
echo "==> setup: installing Debian packages:$missing"
apt-get update -qq
# shellcheck disable=SC2086  # a list of words
DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $missing > /dev/null
