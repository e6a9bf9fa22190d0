"""Kernels for narrower vectors: PoCL compiles for any processor that it is told of."""

import os
import subprocess
import sys

import pytest

from gspure.opencl.device import choose_device

NARROW = {"POCL_LLVM_CPU_NAME": "haswell", "POCL_KERNELLIB_NAME": "avx2"}
DIGESTS = """
import numpy as np
from gspure.files import digest
from gspure.method.clusters import select
from gspure.method.tree import spanning_tree
from gspure.opencl.device import choose_device
from gspure.renderer import Renderer
from tests.models import blobs, tilted_camera

model, view = blobs(2000, 1), tilted_camera()
print(choose_device().name)
for energy in ("ewa", "ray"):
    renderer = Renderer(model, energy=energy)
    arrays = renderer.image(view), renderer.contributions(view), renderer.depth(view)
    print(energy, *map(digest, arrays))
image, pullback = Renderer(model).vjp(view)
gradients = vars(pullback(np.ones_like(image)))
print(*(f"{name} {digest(gradient)}" for name, gradient in gradients.items()))
tree = spanning_tree(np.random.default_rng(0).normal(size=(2000, 5)))
print("clusters", digest(tree), digest(select(tree, 20, "leaf")))
"""


def digests(environment):
    """Return the device's name and the digests of all results, from a process of its own."""
    command = [sys.executable, "-c", DIGESTS]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_kernels_for_avx2_give_the_bits_of_kernels_for_avx512():
    if "avx512" not in choose_device().cl_device.version:
        pytest.skip("PoCL does not compile for AVX-512 here")
    (_, *wide), (name, *narrow) = digests({}), digests(NARROW)
    if "haswell" not in name:
        pytest.skip("this PoCL compiles for one processor only")
    assert len(wide) == 4
    assert narrow == wide
