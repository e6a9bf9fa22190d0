"""Devices: listed, chosen, tried in processes of their own; `gspure doctor`; equal bits for any number of threads."""

import argparse
import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyopencl as cl
import pytest

from gspure.cli import doctor
from gspure.constants import TILE
from gspure.errors import InputError
from gspure.opencl import device as devices
from gspure.opencl import selftest
from gspure.opencl.blending import _batch
from gspure.opencl.device import choose_device, list_devices, works
from gspure.opencl.engine import Engine, Program, _kernels, device_identity
from gspure.opencl.frame import Traversal
from gspure.opencl.selftest import Trial
from gspure.renderer import Renderer
from tests.models import blobs, tilted_camera

CPU, GPU = cl.device_type.CPU, cl.device_type.GPU


def fake_platform(name: str, version: str, devices: dict[str, int]) -> SimpleNamespace:
    """The attributes of a pyopencl.Platform that are read; its devices are given by name and type."""
    platform = SimpleNamespace(name=name, version=version)
    facts = {"platform": platform, "driver_version": "1", "version": "OpenCL 3.0"}
    found = [SimpleNamespace(name=device, type=kind, **facts) for device, kind in devices.items()]
    platform.get_devices = lambda: found
    return platform


POCL = fake_platform("Portable Computing Language", "OpenCL 3.0 PoCL 3.1", {"pthread-EPYC": CPU})
CARDS = fake_platform("Cards Inc.", "OpenCL 3.0", {"Card A": GPU, "Card B": GPU})


@pytest.fixture
def machine(monkeypatch):
    """Return a function that sets the machine's platforms and the names of the devices on which nothing runs."""
    monkeypatch.delenv("GSPURE_DEVICE", raising=False)

    def set_up(*platforms: SimpleNamespace, broken: tuple[str, ...] = ()) -> None:
        monkeypatch.setattr(devices, "_platforms", lambda: list(platforms))
        monkeypatch.setattr(devices, "defect", lambda d: "does not build" if d.name in broken else None)
        list_devices.cache_clear()

    yield set_up
    list_devices.cache_clear()


@pytest.mark.parametrize(
    ("spec", "name"), [("2", "pthread-EPYC"), ("card b", "Card B"), ("pocl", "pthread-EPYC"), ("inc.", "Card A")]
)
def test_gpus_come_first_and_a_device_is_selected_by_index_or_part_of_its_name(machine, spec: str, name: str) -> None:
    machine(POCL, CARDS)
    assert choose_device(spec).name == name


def test_the_default_is_the_first_device_that_works_and_a_named_one_is_not_replaced(machine, monkeypatch) -> None:
    machine(POCL, CARDS, broken=("Card A", "Card B"))
    assert choose_device().name == "pthread-EPYC"
    machine(POCL, CARDS, broken=("Card A",))
    assert choose_device().name == "Card B"
    with pytest.raises(InputError, match=r"0: Card A \(Cards Inc.\): does not build .*gspure doctor"):
        choose_device("Card A")
    monkeypatch.setenv("GSPURE_DEVICE", "0")
    with pytest.raises(InputError, match="does not build"):
        choose_device()


def test_wrong_results_are_a_defect(monkeypatch) -> None:
    chosen = choose_device()
    monkeypatch.setattr(devices, "_TRIVIAL_KERNEL", devices._TRIVIAL_KERNEL.replace("FACTOR", "2.0f"))
    assert devices.defect.__wrapped__(chosen) == "a trivial program gives wrong results"


def test_the_identity_of_a_device_names_driver_device_and_kernel_style(machine) -> None:
    machine(POCL)
    (device,) = list_devices()
    assert device_identity(device, "cpu") == device_identity(device)
    changes = {"platform": "Other", "version": "OpenCL 3.0 PoCL 3.2", "driver": "2", "name": "pthread-Xeon"}
    changes["cl_device"] = SimpleNamespace(type=CPU, version="OpenCL 3.0 PoCL HSTR: pthread-x86_64-skylake")
    others = [device_identity(replace(device, **{field: value})) for field, value in changes.items()]
    assert len({device_identity(device), device_identity(device, "gpu"), *others}) == 7


def test_kernels_compile_without_warnings(monkeypatch, device, style) -> None:
    """PoCL prints the number of warnings to standard error, whatever a program does with them."""
    logs = []

    def compiled(context, source, options):
        unique = f"constant int unique_{os.urandom(8).hex()} = 0;"  # else the driver's cache may have it
        program = devices.built(context, f"{source}\n{unique}\n", options, cached=False)
        logs.append(program.get_build_info(context.devices[0], cl.program_build_info.LOG))
        return program

    monkeypatch.setattr("gspure.opencl.engine.built", compiled)
    monkeypatch.setattr("gspure.opencl.engine._kernels", _kernels.__wrapped__)
    view = tilted_camera(33, 31)
    for energy in ("ewa", "ray"):
        Renderer(blobs(5), device, energy=energy, style=style).contributions(view)
    image, pullback = Renderer(blobs(5), device, style=style).vjp(view)
    pullback(image)
    assert len(logs) > 5
    assert [line for log in logs for line in log.splitlines() if "warning" in line] == []


LISTING = '[{"index": 0, "kind": "cpu", "name": "a", "platform": "p", "driver": "1", "selected": true}]'


def test_every_device_is_tried_in_a_process_of_its_own() -> None:
    trials = selftest.try_devices()
    assert [(each.index, each.name) for each in trials] == [(d.index, d.name) for d in list_devices()]
    assert [each.problem is None for each in trials] == [works(d) for d in list_devices()]


@pytest.mark.parametrize(
    ("status", "words", "problem"),
    [
        (-6, 'note\nerror: Executable "ld" doesn\'t exist!\nerror: linking failed', 'Executable "ld" doesn\'t exist!'),
        (-11, "", "the driver ended the process (status -11)"),
    ],
)
def test_a_driver_that_ends_its_process_is_a_problem_of_that_device(monkeypatch, status, words, problem) -> None:
    def child(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(arguments, status if arguments else 0, "" if arguments else LISTING, words)

    monkeypatch.setattr(selftest, "_child", child)
    (tried,) = selftest.try_devices()
    assert (tried.index, tried.problem) == (0, problem)


def test_a_frame_whose_light_does_not_add_up_is_a_problem(monkeypatch) -> None:
    device = choose_device()
    assert selftest.frame_problem(device) is None
    monkeypatch.setattr(Engine, "read", lambda _, buffer, shape, dtype: np.full(shape, 0.5, dtype))
    assert selftest.frame_problem(device) == "a small frame gives wrong results"


@pytest.mark.parametrize("code", ["MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY"])
def test_a_driver_that_lacks_memory_only_when_a_kernel_starts_is_reported(device, monkeypatch, code):
    def fails(*_):
        raise cl.MemoryError(cl._cl._ErrorRecord("", getattr(cl.status_code, code), "clEnqueueNDRangeKernel"))

    engine, fails.set_scalar_arg_dtypes = Engine(device.cl_device), list
    program = Program({"fails": fails}, engine.queue, 1)
    with pytest.raises(InputError, match=f"memory: expected room for all buffers at once, found .*{code}"):
        program.launch("fails", 1)


@pytest.mark.parametrize("contributions", [False, True])
@pytest.mark.parametrize("channels", [0, 3, 17, 300])
@pytest.mark.parametrize("kib", [2, 7, 16, 48, 64, 1024])
def test_a_work_group_stages_as_many_splats_as_three_quarters_of_local_memory_hold(kib, channels, contributions):
    traversal = Traversal("ewa", channels=channels, contributions=contributions)
    device = SimpleNamespace(local_mem_size=kib << 10)
    batch = _batch(SimpleNamespace(engine=SimpleNamespace(device=device), traversal=traversal))
    floats = 7 + channels + (3 if contributions else 0)
    assert 4 * floats * batch <= 0.75 * device.local_mem_size
    assert batch == TILE * TILE or 2 * 4 * floats * batch > 0.75 * device.local_mem_size


WORKING = Trial(
    index=0, kind="cpu", name="EPYC", platform="PoCL", driver="3.1", selected=True, problem=None, seconds=1.0
)
BROKEN = replace(WORKING, index=1, driver="3.0", problem="unknown target CPU")
DRIVER = "-m pip install intel-opencl-rt intel-cmplr-lib-rt"


@pytest.mark.parametrize(
    ("trials", "processor", "opengl", "numpy", "status", "fix"),
    [
        ((WORKING,), "x86_64", "llvmpipe", "2.4.6", 0, None),
        ((BROKEN, WORKING), "x86_64", "llvmpipe", "2.4.6", 0, None),
        ((BROKEN,), "x86_64", "llvmpipe", "2.4.6", 1, DRIVER),
        ((), "aarch64", "llvmpipe", "2.4.6", 1, "sudo apt-get install pocl-opencl-icd"),
        ((replace(WORKING, selected=False),), "x86_64", "llvmpipe", "2.4.6", 1, "unset GSPURE_DEVICE"),
        ((WORKING,), "x86_64", None, "2.4.6", 0, "sudo apt-get install libegl1 libgl1-mesa-dri"),
        ((WORKING,), "x86_64", "llvmpipe", None, 1, "-m pip install 'numpy<3,>=1.26'"),
        ((WORKING,), "x86_64", "llvmpipe", "3.0.0", 1, "-m pip install 'numpy<3,>=1.26'"),
    ],
)
def test_each_fault_has_one_fix(monkeypatch, capsys, trials, processor, opengl, numpy, status, fix):
    def version(name):
        if not numpy:
            raise metadata.PackageNotFoundError(name)
        return numpy

    monkeypatch.setattr("gspure.opencl.selftest.try_devices", lambda: list(trials))
    monkeypatch.setattr("gspure.figures.plates.opengl_renderer", lambda: opengl)
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy<3,>=1.26", 'ruff>=0.12; extra == "dev"'])
    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr("platform.machine", lambda: processor)
    monkeypatch.setattr(doctor, "_make", lambda _: None)
    assert doctor.run(argparse.Namespace(fix=False)) == status
    text = capsys.readouterr().out
    assert ("EPYC  PoCL 3.1  1.0 s, in use" in text) == (WORKING in trials)
    assert re.search(r"ok  marked_clones +gspure_marked_clones 1\.0 +marked_clones, rendered_bits$", text, re.MULTILINE)
    fixes = [line for line in text.splitlines() if "fix: " in line]
    assert len(fixes) == (fix is not None)
    assert not fix or fixes[0].endswith(fix)


NARROW = {"POCL_LLVM_CPU_NAME": "haswell", "POCL_KERNELLIB_NAME": "avx2"}
DIGESTS = """
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


@cache
def digests(**environment: str) -> list[str]:
    """Return the device's name and the digests of all results, from a process that PoCL configures by its variables."""
    command, root = [sys.executable, "-c", DIGESTS], Path(__file__).parents[1]
    return subprocess.check_output(command, env=os.environ | environment, cwd=root, text=True).splitlines()


def test_the_number_of_threads_does_not_matter() -> None:
    one, *others = (digests(POCL_MAX_PTHREAD_COUNT=threads) for threads in "123")
    assert len(one) == 5
    assert others == [one, one]


def test_kernels_for_avx2_give_the_bits_of_kernels_for_avx512() -> None:
    if "avx512" not in choose_device().cl_device.version:
        pytest.skip("PoCL does not compile for AVX-512 here")
    (_, *wide), (name, *narrow) = digests(POCL_MAX_PTHREAD_COUNT="1"), digests(**NARROW)
    if "haswell" not in name:
        pytest.skip("this PoCL compiles for one processor only")
    assert narrow == wide
