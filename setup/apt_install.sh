#!/usr/bin/env bash
# Install Debian packages for the whole machine: as root, or with sudo if it asks for no password.
# usage: setup/apt_install.sh PACKAGE...     (the output of apt goes to standard error)
set -eu
command -v apt-get >/dev/null || exit 1
apt=(env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300)
if [ "$(id -u)" != 0 ]; then
  sudo -n true 2>/dev/null || exit 1
  apt=(sudo -n "${apt[@]}")
fi
echo "setup: apt-get install $*"
"${apt[@]}" install --no-install-recommends "$@" >&2 ||
  { "${apt[@]}" update && "${apt[@]}" install --no-install-recommends "$@"; } >&2
