"""Devices: listed, chosen, tried in a process of their own; their memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pyopencl as cl
import pytest

from gspure.constants import TILE
from gspure.errors import InputError
from gspure.opencl import device as devices
from gspure.opencl import selftest
from gspure.opencl.blending import _batch
from gspure.opencl.device import choose_device, list_devices, works
from gspure.opencl.engine import Engine, Program, _kernels, device_identity
from gspure.opencl.frame import Traversal
from gspure.opencl.storage import BLOCK, blocked_shape, upload_attributes
from gspure.renderer import Renderer
from tests.models import blobs, tilted_camera

CPU, GPU = cl.device_type.CPU, cl.device_type.GPU


@dataclass(frozen=True)
class FakeDevice:
    """The attributes of a pyopencl.Device that are read."""

    name: str
    type: int
    driver_version: str = "1"
    version: str = "OpenCL 3.0"
    platform: FakePlatform | None = None


@dataclass(frozen=True)
class FakePlatform:
    """A pyopencl.Platform; `found` None stands for a driver that fails when asked for its devices."""

    name: str
    version: str = "OpenCL 3.0"
    found: tuple[FakeDevice, ...] | None = field(default=(), compare=False)

    def get_devices(self) -> list[FakeDevice]:
        if self.found is None:
            raise cl.LogicError("DEVICE_NOT_FOUND")
        return [replace(each, platform=self) for each in self.found]


POCL = FakePlatform("Portable Computing Language", "OpenCL 3.0 PoCL 3.1", (FakeDevice("pthread-EPYC", CPU),))
CARDS = FakePlatform("Cards Inc.", found=(FakeDevice("Card A", GPU), FakeDevice("Card B", GPU)))


@pytest.fixture
def machine(monkeypatch):
    """Return a function that sets the machine's platforms and the names of the devices on which nothing runs."""
    monkeypatch.delenv("GSPURE_DEVICE", raising=False)

    def set_up(*platforms: FakePlatform, broken: tuple[str, ...] = ()) -> None:
        monkeypatch.setattr(devices, "_platforms", lambda: list(platforms))
        monkeypatch.setattr(devices, "defect", lambda d: "does not build" if d.name in broken else None)
        list_devices.cache_clear()

    yield set_up
    list_devices.cache_clear()


def test_gpus_come_before_cpus_and_are_numbered_so(machine) -> None:
    machine(POCL, CARDS)
    expected = [(0, "gpu", "Card A"), (1, "gpu", "Card B"), (2, "cpu", "pthread-EPYC")]
    assert [(d.index, d.kind, d.name) for d in list_devices()] == expected


def test_the_default_is_the_first_device_that_works(machine) -> None:
    machine(POCL, CARDS, broken=("Card A",))
    assert choose_device().name == "Card B"
    machine(POCL, CARDS, broken=("Card A", "Card B"))
    assert choose_device().name == "pthread-EPYC"


@pytest.mark.parametrize(
    ("spec", "name"), [("2", "pthread-EPYC"), ("card b", "Card B"), ("pocl", "pthread-EPYC"), ("inc.", "Card A")]
)
def test_a_device_is_selected_by_index_or_part_of_its_name(machine, spec: str, name: str) -> None:
    machine(POCL, CARDS)
    assert choose_device(spec).name == name


def test_a_named_device_that_does_not_work_is_not_replaced(machine, monkeypatch) -> None:
    machine(POCL, CARDS, broken=("Card A",))
    with pytest.raises(InputError, match=r"0: Card A \(Cards Inc.\): does not build .*gspure doctor"):
        choose_device("Card A")
    monkeypatch.setenv("GSPURE_DEVICE", "0")
    with pytest.raises(InputError, match="does not build"):
        choose_device()


@pytest.mark.parametrize("spec", [None, "0"])
def test_no_driver_gives_one_line_with_the_command_that_helps(machine, spec: str | None) -> None:
    machine()
    with pytest.raises(InputError, match=r"no device .*gspure doctor") as error:
        choose_device(spec)
    assert "\n" not in str(error.value)


def test_wrong_results_are_a_defect(monkeypatch) -> None:
    chosen = choose_device()
    monkeypatch.setattr(devices, "_TRIVIAL_KERNEL", devices._TRIVIAL_KERNEL.replace("FACTOR", "2.0f"))
    assert devices.defect.__wrapped__(chosen) == "a trivial program gives wrong results"


def test_the_identity_of_a_device_names_driver_device_and_kernel_style(machine):
    def one_identity(platform: FakePlatform, **changes: object) -> str:
        machine(replace(platform, found=(replace(POCL.found[0], **changes),)))
        return device_identity(list_devices()[0])

    plain = one_identity(POCL)
    assert one_identity(POCL) == plain
    assert device_identity(list_devices()[0], "cpu") == plain
    others = [
        device_identity(list_devices()[0], "gpu"),
        one_identity(replace(POCL, name="Other")),
        one_identity(replace(POCL, version="OpenCL 3.0 PoCL 3.2")),
        one_identity(POCL, driver_version="2"),
        one_identity(POCL, name="pthread-Xeon"),
        one_identity(POCL, version="OpenCL 3.0 PoCL HSTR: pthread-x86_64-skylake"),
    ]
    assert len({plain, *others}) == 7


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
        (
            1,
            'Traceback\n  File "errors.py", line 1\npyopencl._cl.RuntimeError: clBuildProgram',
            "RuntimeError: clBuildProgram",
        ),
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


@pytest.mark.parametrize(("count", "blocks"), [(0, 1), (1, 1), (BLOCK, 1), (BLOCK + 1, 2), (10 * BLOCK, 10)])
def test_only_the_last_block_of_gaussians_is_padded(count, blocks):
    assert blocked_shape(count, 11) == (blocks, 11, BLOCK)


def test_attributes_lie_in_storage_order_in_blocks_padded_with_zeros(device):
    values = np.random.default_rng(0).normal(size=(BLOCK + 3, 2)).astype(np.float32)
    order, engine = np.arange(len(values), dtype=np.uint32)[::-1].copy(), Engine(device.cl_device)
    buffer = upload_attributes(engine, order, 2, lambda rows: values[rows])
    positions = engine.read(buffer, blocked_shape(len(values), 2), np.float32).swapaxes(1, 2).reshape(-1, 2)
    assert np.array_equal(positions[: len(values)], values[::-1])
    assert not positions[len(values) :].any()


def test_memory_that_is_mapped_to_be_read_is_not_written(device):
    """On some devices, what is written would be lost."""
    engine = Engine(device.cl_device)
    buffer = engine.uploaded(np.zeros(16, np.uint32))
    with engine.mapped(buffer, (16,), np.uint32) as words, pytest.raises(ValueError, match="read-only"):
        words[0] = 1


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


@pytest.mark.parametrize("variable", ["POCL_CACHE_DIR", "XDG_CACHE_HOME", "HOME"])
def test_a_kernel_cache_that_cannot_be_written_is_replaced_and_said_once(variable) -> None:
    environment = {name: text for name, text in os.environ.items() if name not in {"POCL_CACHE_DIR", "XDG_CACHE_HOME"}}
    command = [sys.executable, "-m", "gspure.opencl.selftest"]
    environment |= {variable: "/proc/none"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert json.loads(done.stdout)
    assert done.stderr.count("temporary folder") == 1


def test_a_program_that_is_built_again_is_kept_as_a_binary(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    device = choose_device().cl_device
    if device.platform.name != devices.POCL:
        pytest.skip("other drivers keep binaries themselves")
    context, sizes = cl.Context([device]), []
    for _ in range(3):
        program = devices.built(context, devices._TRIVIAL_KERNEL, ["-DFACTOR=7.0f"])
        sizes += [path.stat().st_size for path in tmp_path.glob("gspure/*.bin")]
    assert sizes[0] == 0 < sizes[1] == sizes[2]
    assert program.get_info(cl.program_info.SOURCE) == ""
    assert [kernel.function_name for kernel in program.all_kernels()] == ["scale"]
