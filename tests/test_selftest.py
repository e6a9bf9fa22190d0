"""Every device is tried on a frame, and a driver that ends its process affects only that device."""

import subprocess

import numpy as np
import pytest

from gspure.opencl import selftest
from gspure.opencl.device import choose_device, list_devices, works
from gspure.opencl.engine import Engine

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
