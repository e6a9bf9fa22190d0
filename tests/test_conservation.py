"""Contributions that no model can have are refused, whatever computed them."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.opencl.conservation import require_conservation
from gspure.renderer import CONTRIBUTION, Renderer
from tests.models import blobs, camera


def sound():
    """Rows 3 and 7 in an image of 2 x 2 pixels."""
    contributions = np.array([(3, 1.25, 0.75, 2), (7, 0.5, 0.5, 1)], CONTRIBUTION)
    return contributions, np.array([[0.25, 0.5], [0.5, 1.0]], np.float32)


def test_sound_contributions_pass():
    require_conservation("front", *sound())
    require_conservation("front", np.zeros(0, CONTRIBUTION), np.ones((2, 2), np.float32))


def test_violated_conservation_of_light_is_detected():
    contributions, transmittance = sound()
    for factor, fails in ((1.0, False), (1 + 2e-5, False), (1 + 1e-3, True), (1 - 1e-3, True)):
        changed = contributions.copy()
        changed["sum"] *= np.float32(factor)
        if fails:
            with pytest.raises(InputError, match=r"front.*sum of contributions"):
                require_conservation("front", changed, transmittance)
        else:
            require_conservation("front", changed, transmittance)


def test_the_renderer_checks_every_view(device, monkeypatch):
    """As if the device lost the contributions of a band."""
    renderer, view = Renderer(blobs(30, 1), device, energy="ray"), camera(name="front")
    renderer.contributions(view)
    monkeypatch.setattr("gspure.opencl.passes.sum_slots", lambda *_: None)
    with pytest.raises(InputError, match=r"front.*sum of contributions"):
        renderer.contributions(view)
