#!/usr/bin/env bash
# Give a virtual environment an OpenCL device on which a program builds and runs. The first driver that works is kept:
# an installed one; PoCL from Debian, installed or else unpacked; Intel's runtime from PyPI.
# usage: setup/opencl.sh VENV
set -eu
cd "$(dirname "$0")/.."
venv=$(realpath "$1")
log=$venv/opencl.log
: >"$log"

works() { # print the device that works, or fail
  "$venv/bin/python" - 2>>"$log" <<'END'
import sys
from gspure.opencl.selftest import try_devices
trials = try_devices()
print(*(f"{trial.name}: {trial.problem or 'works'}" for trial in trials), sep="\n", file=sys.stderr)
working = [trial for trial in trials if trial.problem is None]
if not working:
    sys.exit(1)
print(f"setup: OpenCL works on {working[0].name}")
END
}

# The loader in the pyopencl wheel reads this folder in addition to the system's.
icd=$("$venv/bin/python" -c 'import pathlib, pyopencl; print(pathlib.Path(pyopencl.__file__).with_name(".libs"))')
# At every start, Python runs the lines of this file that begin with "import".
startup=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/gspure_opencl.pth

pip() {
  "$venv/bin/pip" --quiet --disable-pip-version-check "$@" >>"$log" 2>&1
}

pocl_from_debian() {
  setup/apt_install.sh pocl-opencl-icd 2>>"$log" && works
}

pocl_unpacked() {
  local root=$venv/opt/opencl
  setup/apt_unpack.sh "$root" pocl-opencl-icd 2>>"$log" || return 1
  mkdir "$root/bin" && cp setup/pocl_linker.sh "$root/bin/ld" || return 1
  ls "$root"/usr/lib/*/libpocl.so.*.* | head -n 1 >"$icd/pocl.icd"
  echo "import os; os.environ['PATH'] = os.environ.get('PATH', os.defpath) + os.pathsep + '$root/bin'" >"$startup"
  works && return
  rm -rf "$root" "$icd/pocl.icd" "$startup"
  return 1
}

intel_from_pypi() {
  echo "setup: pip install intel-opencl-rt intel-cmplr-lib-rt (Intel End User License Agreement)"
  pip install intel-opencl-rt==2026.2.0 intel-cmplr-lib-rt==2026.2.0 && works && return
  pip uninstall -y intel-opencl-rt intel-cmplr-lib-rt
  return 1
}

for way in works pocl_from_debian pocl_unpacked intel_from_pypi; do
  if "$way"; then exit 0; fi
done
echo "setup: no OpenCL device works here, and none could be installed (log: $log)." >&2
echo "setup: install the OpenCL driver of your GPU, or PoCL for the CPU, and run \`make opencl\` again." >&2
exit 1
