"""Choosing an OpenCL device, on drivers that are told what to be and on the real one."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace

import pyopencl as cl
import pytest

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.model import write_model
from gspure.opencl import device as devices
from gspure.opencl.device import choose_device, list_devices
from gspure.opencl.engine import _kernels, device_identity
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
    assert [(d.index, d.kind, d.name) for d in list_devices()] == [
        (0, "gpu", "Card A"),
        (1, "gpu", "Card B"),
        (2, "cpu", "pthread-EPYC"),
    ]


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


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (MemoryError("std::bad_alloc"), "gspure render: out of memory: no room to build the kernels"),
        (cl.RuntimeError("clBuildProgram failed:\nerror: no space\n(options: ...)"), "found error: no space"),
    ],
    ids=["memory", "driver"],
)
def test_kernels_that_cannot_be_built_are_reported_in_one_line(tmp_path, monkeypatch, capsys, error, line) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    write_model(tmp_path / "model.ply", blobs(9))
    write_cameras(tmp_path / "cameras.json", [tilted_camera(16, 12)])
    choose_device()
    _kernels.cache_clear()
    monkeypatch.setattr(cl.Program, "build", fail)
    paths = [str(tmp_path / "model.ply"), "--cameras", str(tmp_path / "cameras.json"), "--split", "all"]
    assert main(["render", *paths, "--out", str(tmp_path / "renders")]) == 2
    assert line in capsys.readouterr().err.splitlines()[-1]


def test_kernels_compile_without_warnings(monkeypatch, device, style) -> None:
    """PoCL prints the number of warnings to standard error, whatever a program does with them."""
    logs = []

    def compiled(context, source, options):
        unique = f"constant int unique_{os.urandom(8).hex()} = 0;"  # else the driver's cache may have it
        program = devices.built(context, f"{source}\n{unique}\n", options, cache_dir=False)
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
