"""The same bits for any number of threads, and for kernels of narrower vectors."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gspure.opencl.device import choose_device

NARROW = {"POCL_LLVM_CPU_NAME": "haswell", "POCL_KERNELLIB_NAME": "avx2"}
PROGRAM = """
from gspure.files import digest
from gspure.method.clusters import select
from gspure.method.tree import spanning_tree
from gspure.opencl.device import choose_device
from gspure.renderer import Renderer
from tests.models import blobs, tilted_camera
from tests.test_clustering import with_ties
from tests.test_gradients import bits, gradients
from tests.test_renderer import everything

model, view = blobs(2000, 1), tilted_camera()
print(choose_device().name)
for energy in ("ewa", "ray"):
    print(energy, *map(digest, everything(Renderer(model, energy=energy), view)))
print("gradients", *map(digest, bits(gradients(Renderer(model), view))))
tree = spanning_tree(with_ties(14, 5000))
print("clusters", digest(tree), digest(select(tree, 20, "leaf")))
"""


def digests(**environment: str) -> list[str]:
    """Return the device's name and the digests of all results, from a process that PoCL configures by its variables."""
    command, root = [sys.executable, "-c", PROGRAM], Path(__file__).parents[1]
    return subprocess.check_output(command, env=os.environ | environment, cwd=root, text=True).splitlines()


def test_the_number_of_threads_does_not_matter() -> None:
    one, *others = (digests(POCL_MAX_PTHREAD_COUNT=threads) for threads in "123")
    assert len(one) == 5
    assert others == [one, one]


def test_kernels_for_avx2_give_the_bits_of_kernels_for_avx512() -> None:
    if "avx512" not in choose_device().cl_device.version:
        pytest.skip("PoCL does not compile for AVX-512 here")
    (_, *wide), (name, *narrow) = digests(), digests(**NARROW)
    if "haswell" not in name:
        pytest.skip("this PoCL compiles for one processor only")
    assert narrow == wide
