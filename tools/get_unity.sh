#!/bin/sh
# Puts Unity, the C test framework, into a folder.  usage: get_unity.sh PYTHON FOLDER
#
# Debian has no package of Unity.  The source package of pytest-unity, a pytest plugin that is not used here, carries
# Unity's release unchanged; pip downloads it by name and refuses it if its hash is not the one in unity.txt.
set -eu
python=$1
folder=$2
archive_folder=vendor/unity

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m pip --disable-pip-version-check --quiet download --no-deps --no-binary :all: --dest "$work" \
    --require-hashes --requirement "$(dirname "$0")/unity.txt"
tar -xzf "$work"/pytest_unity-*.tar.gz -C "$work" --strip-components=1

mkdir -p "$folder"
for file in LICENSE.txt src/unity_internals.h src/unity.h src/unity.c; do
    cp "$work/$archive_folder/$file" "$folder/"
done
