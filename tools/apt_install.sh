#!/bin/sh
# Makes sure that commands exist, from Debian packages where they do not.
# usage: apt_install.sh COMMAND:PACKAGE...      an empty COMMAND: the package is missing for another reason
set -eu

missing=
for pair in "$@"; do
    command=${pair%%:*}
    if [ -z "$command" ] || ! command -v "$command" > /dev/null; then
        missing="$missing ${pair#*:}"
    fi
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
