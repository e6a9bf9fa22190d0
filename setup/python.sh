#!/usr/bin/env bash
# Make a virtual environment with the first Python that is new enough and has the venv module.
# usage: setup/python.sh FOLDER     ($PYTHON names the interpreter to use)
set -eu
folder=$1

why_not() { # INTERPRETER [ARGUMENT...]: print why it is not suitable, or nothing
  "$@" 2>/dev/null <<'END' || echo "does not start"
import importlib.util, sys
version = "%d.%d" % sys.version_info[:2]
if sys.version_info < (3, 11):
    print("is Python " + version)
elif not importlib.util.find_spec("ensurepip"):
    print("lacks the venv module (on Debian and Ubuntu: sudo apt-get install python%s-venv)" % version)
END
}

if [ -x "$folder/bin/pip" ] && [ -z "$(why_not "$folder/bin/python" -)" ]; then
  exit 0
fi
rejected=
for python in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
  command -v "$python" >/dev/null || continue
  reason=$(why_not "$python" -)
  if [ -z "$reason" ]; then
    echo "setup: making $folder with $("$python" --version)"
    exec "$python" -m venv --clear "$folder"
  fi
  rejected+=$'\n'"  $python $reason"
done
echo "setup: gspure needs Python 3.11 or newer with its venv module.${rejected:-$'\n'  no Python was found on PATH}" >&2
exit 1
