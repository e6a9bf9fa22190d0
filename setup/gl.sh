#!/usr/bin/env bash
# Give a virtual environment an OpenGL that draws without a display, for the 3-D figures: the installed one or, if it
# does not work, Mesa from Debian, installed or unpacked. Without OpenGL, only the 3-D figures are missing.
# usage: setup/gl.sh VENV
set -eu
cd "$(dirname "$0")/.."
venv=$(realpath "$1")
log=$venv/gl.log
: >"$log"

works() { # print the name of the OpenGL renderer, or fail
  "$venv/bin/python" - 2>>"$log" <<'END'
import sys
from gspure.figures.plates import opengl_renderer
renderer = opengl_renderer()
if not renderer:
    sys.exit("off-screen rendering fails")
print(f"setup: OpenGL draws with {renderer}")
END
}

packages=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')

mesa_from_debian() {
  setup/apt_install.sh libegl1 libgl1-mesa-dri 2>>"$log" && works
}

mesa_unpacked() {
  local root=$venv/opt/gl egl
  setup/apt_unpack.sh "$root" libegl1 libgl1-mesa-dri 2>>"$log" || return 1
  egl=$(ls "$root"/usr/lib/*/libEGL.so.1)
  ln -sf "$egl" "$packages/vtkmodules/libEGL.so.1" # VTK looks beside its own libraries first
  cat >"$root/egl.json" <<END
{"file_format_version": "1.0.0", "ICD": {"library_path": "$(dirname "$egl")/libEGL_mesa.so.0"}}
END
  # Python runs this line whenever it starts.
  cat >"$packages/gspure_gl.pth" <<END
import os; os.environ.setdefault("__EGL_VENDOR_LIBRARY_FILENAMES", "$root/egl.json"); os.environ.setdefault("LIBGL_DRIVERS_PATH", "$(dirname "$egl")/dri")
END
  works && return
  rm -rf "$root" "$packages/vtkmodules/libEGL.so.1" "$packages/gspure_gl.pth"
  return 1
}

for way in works mesa_from_debian mesa_unpacked; do
  if "$way"; then exit 0; fi
done
echo "setup: no OpenGL works here (log: $log): there will be no 3-D figures."
