"""The kernels in oclgrind, a simulator that reports data races and invalid memory accesses."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.oclgrind

LIBRARY = "liboclgrind-rt-icd.so"

TESTS = {
    "images": "test_renderer.py::test_any_number_of_gaussians_agrees[{style}-ewa-device0-17]",
    "rays": "test_renderer.py::test_any_number_of_gaussians_agrees[{style}-ray-device0-17]",
    "points": "test_opacity_field.py::test_any_image_size_and_number_of_points_agrees[{style}-device0-size2-17]",
    "gradients": "test_gradients.py::test_gradients_of_any_number_of_gaussians_agree[{style}-device0-17]",
    "training": "test_trainable.py::test_statistics_add_up_gradients_of_centres_in_units_of_the_image[{style}-device0]",
}


@pytest.fixture
def simulate(tmp_path):
    """Run Python with these arguments on the simulator; return what it has to report."""
    command = shutil.which("oclgrind")
    folder = Path(command or "").resolve().parents[1] / "lib" if command else Path()
    found = [*folder.glob(f"oclgrind/{LIBRARY}"), *folder.glob(f"*/oclgrind/{LIBRARY}"), *folder.glob(LIBRARY)]
    if not found:
        pytest.skip("oclgrind is not installed (Debian package: oclgrind)")
    vendors = tmp_path / "vendors"
    vendors.mkdir()
    (vendors / "oclgrind.icd").write_text(f"{found[0]}\n")

    def run(*arguments):
        log = tmp_path / "log.txt"
        environment = {
            "OCL_ICD_VENDORS": str(vendors),
            "OCLGRIND_BUILD_OPTIONS": "-cl-opt-disable",  # optimized, a true comparison of vectors counts 255, not 1
            "OCLGRIND_CHECK_API": "1",
            "OCLGRIND_DATA_RACES": "1",
            "OCLGRIND_LOG": str(log),
            "PYOPENCL_NO_CACHE": "1",
        }
        done = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, **environment},
            cwd=Path(__file__).parents[1],
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        # Asking for a property that OpenCL 1.2 does not know is no mistake.
        calls = {function for function in re.findall(r"Function: (\w+)", done.stderr) if not function.endswith("Info")}
        return log.read_text() + " ".join(sorted(calls))

    return run


@pytest.mark.parametrize("kernels", TESTS)
def test_the_kernels_have_no_race_and_no_invalid_access(simulate, style, kernels):
    assert simulate("-m", "pytest", "-q", "-s", "tests/" + TESTS[kernels].format(style=style)) == ""
