"""Choosing an OpenCL device, on drivers that are told what to be and on the real one."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from dataclasses import dataclass, field, replace

import pyopencl as cl
import pytest

from gspure.errors import InputError
from gspure.opencl import device as devices
from gspure.opencl.device import choose_device, list_devices, matching_devices
from gspure.opencl.engine import _built, device_identity

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
        monkeypatch.setattr(devices, "fault", lambda d: "does not build" if d.name in broken else None)
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


def test_the_environment_names_a_device_and_an_argument_overrules_it(machine, monkeypatch) -> None:
    machine(POCL, CARDS)
    monkeypatch.setenv("GSPURE_DEVICE", "pocl")
    assert choose_device().name == "pthread-EPYC"
    assert choose_device("Card A").name == "Card A"


def test_a_named_device_that_does_not_work_is_not_replaced(machine, monkeypatch) -> None:
    machine(POCL, CARDS, broken=("Card A",))
    with pytest.raises(InputError, match=r"0: Card A \(Cards Inc.\): does not build .*make opencl"):
        choose_device("Card A")
    monkeypatch.setenv("GSPURE_DEVICE", "0")
    with pytest.raises(InputError, match="does not build"):
        choose_device()


@pytest.mark.parametrize("spec", ["7", "nvidia"])
def test_a_missing_device_is_refused_with_a_list_of_devices(machine, spec: str) -> None:
    machine(POCL)
    with pytest.raises(InputError, match=r"OpenCL: device: .*0: pthread-EPYC"):
        matching_devices(spec)


@pytest.mark.parametrize("spec", [None, "0"])
def test_no_driver_gives_one_line_with_the_command_that_helps(machine, spec: str | None) -> None:
    machine()
    with pytest.raises(InputError, match=r"no device .*make opencl") as error:
        choose_device(spec)
    assert "\n" not in str(error.value)


def test_a_driver_without_hardware_is_skipped(machine) -> None:
    machine(FakePlatform("No card inside", found=None), POCL)
    assert [d.name for d in list_devices()] == ["pthread-EPYC"]


def test_some_device_of_this_machine_works() -> None:
    chosen = choose_device()
    assert devices.works(chosen)
    assert chosen in list_devices()


def test_a_device_works_without_a_writable_home(tmp_path) -> None:
    (tmp_path / "home").write_text("a file")
    environment = {
        name: value for name, value in os.environ.items() if name not in {"XDG_CACHE_HOME", "POCL_CACHE_DIR"}
    }
    environment |= {"HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path)}
    code = "from gspure.opencl.device import choose_device; print(choose_device().name)"
    child = subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True)
    assert child.stdout.strip() == choose_device().name
    assert [path.name for path in tmp_path.iterdir()] == ["home"]


def test_a_failed_build_is_reported_by_its_first_error(monkeypatch) -> None:
    chosen = choose_device()
    monkeypatch.setattr(devices, "_TRIVIAL_KERNEL", "kernel void scale(global int *a) { a[0] = nothing_here; }")
    reason = devices.fault.__wrapped__(chosen)
    assert "nothing_here" in reason
    assert "\n" not in reason


def test_wrong_results_are_a_fault(monkeypatch) -> None:
    chosen = choose_device()
    monkeypatch.setattr(devices, "_TRIVIAL_KERNEL", devices._TRIVIAL_KERNEL.replace("FACTOR", "2.0f"))
    assert devices.fault.__wrapped__(chosen) == "a trivial program gives wrong results"


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


def test_warnings_of_the_compiler_are_not_shown(monkeypatch) -> None:
    noisy = "#warning unique " + os.urandom(8).hex() + "\n" + devices._TRIVIAL_KERNEL
    context = cl.Context([choose_device().cl_device])
    with pytest.warns(cl.CompilerWarning):
        cl.Program(context, noisy).build(["-DFACTOR=2.0f"], cache_dir=False)
    monkeypatch.setattr("gspure.opencl.engine.kernel_source", lambda *names: noisy)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _built(context, (), (("FACTOR", 2),))
