#!/usr/bin/env bash
# Install Chromium from Debian, for the tests of the pages, unless a browser of its kind is there. Without one, these
# tests are skipped.
# usage: setup/browser.sh
set -eu
cd "$(dirname "$0")/.."

works() { # print the version of the browser that tests/conftest.py finds, or fail
  for name in chromium chromium-browser google-chrome; do
    if command -v "$name" >/dev/null; then
      echo "setup: the tests of the pages use $("$name" --version 2>/dev/null)"
      return
    fi
  done
  return 1
}

if works || { setup/apt_install.sh chromium 2>/dev/null && works; }; then exit 0; fi
echo "setup: no Chromium here, and apt installs none: the tests of the pages are skipped."
