#!/usr/bin/env bash
# Unpack Debian packages and their missing dependencies into a folder, without root. The run path of each library is set
# to this folder, so that it loads without LD_LIBRARY_PATH.
# usage: setup/apt_unpack.sh FOLDER PACKAGE...
# FOLDER appears when everything is unpacked; the output of apt goes to standard error.
set -eu
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || exit 1
folder=$(realpath -m "$1")
shift
partial=$folder.partial
rm -rf "$partial"
trap 'rm -rf "$partial"' EXIT
mkdir -p "$partial"/apt/{lists,archives}/partial "$partial/tree"

echo "setup: no root here, unpacking the Debian packages $*"
apt=(apt-get -q -y -o Debug::NoLocking=1 -o Dir::Cache="$partial/apt" -o Dir::State::Lists="$partial/apt/lists")
{
  "${apt[@]}" update
  "${apt[@]}" install --download-only --no-install-recommends "$@" patchelf
} >&2
for package in "$partial"/apt/archives/*.deb; do
  dpkg-deb -x "$package" "$partial/tree"
done

libraries=$(cd "$partial/tree" && ls -d usr/lib/*-linux-gnu* | head -n 1)
patchelf=$(command -v patchelf || echo "$partial/tree/usr/bin/patchelf")
find "$partial/tree/usr/lib" -name '*.so*' -type f |
  while read -r library; do
    # Some files are text for the linker and need no run path.
    "$patchelf" --force-rpath --set-rpath "$folder/$libraries" "$library" >&2 || true
  done
rm -rf "$folder"
mv "$partial/tree" "$folder"
