"""Whether an owner can read the message that was just embedded: its PSNR beside those of negative controls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from gspure.evaluation.controls import BLACK, MEAN_COLOUR, WRONG_KEY
from gspure.evaluation.metrics import psnr
from gspure.evaluation.survival import MARGIN
from gspure.opencl.device import Device
from gspure.progress import say, warn
from gspure.public_model import PublicModel
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import MESSAGE, Key

VIEWS: Final = 4
"""Number of training views: those whose photographs vary most, since a small object is not in all. Ours."""


@dataclass(frozen=True)
class Readability:
    """PSNR over all pixels of a few training views, dB: of the owner's extraction, and of negative controls.

    These are black, the photographs' mean colour, and an extraction with a wrong key.
    """

    message: float
    controls: dict[str, float]

    @property
    def readable(self) -> bool:
        """Whether the message stands out from all controls."""
        return self.message >= max(self.controls.values()) + MARGIN

    def report(self) -> None:
        """Print the numbers, as a warning if the message is not readable."""
        best = max(self.controls, key=lambda name: self.controls[name])
        numbers = f"message PSNR {self.message:.1f} dB; highest control {self.controls[best]:.1f} dB ({best})"
        if self.readable:
            say(numbers)
        else:
            warn(f"the message is NOT readable: {numbers}")


def readability(capture: Capture, public: PublicModel, key: Key, device: Device | None = None) -> Readability:
    """Compare the message, and its negative controls, with the photographs of a few training views."""
    chosen = sorted(range(len(capture.images)), key=lambda view: -capture.images[view].std())[:VIEWS]
    truth = np.concatenate([capture.images[view].reshape(-1, 3) for view in chosen])

    def quality(of: Key) -> float:
        view = of.message(public, MESSAGE, device)
        images = [view(capture.views[i]).clip(0, 1).reshape(-1, 3) for i in chosen]
        return psnr(np.concatenate(images), truth)

    controls = {
        BLACK: psnr(np.zeros_like(truth), truth),
        MEAN_COLOUR: psnr(np.broadcast_to(truth.mean(axis=0), truth.shape), truth),
        WRONG_KEY: quality(key.wrong(np.random.default_rng(0))),
    }
    return Readability(quality(key), controls)
