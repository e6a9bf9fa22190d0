"""Whether an owner can read the message that was just embedded, beside negative controls."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.evaluation.detection import Threshold, as_bits, share_correct
from gspure.evaluation.metrics import psnr
from gspure.evaluation.names import BLACK, MEAN_COLOUR, WRONG_KEY, display_name
from gspure.evaluation.retrieval import FALSE_POSITIVES
from gspure.evaluation.survival import MARGIN
from gspure.images import mean_colour, read_back
from gspure.opencl.device import Device
from gspure.progress import decimal, percent, say, warn
from gspure.public_model import PublicModel
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import MESSAGE, Key, wrong_key

VIEWS: Final = 4  # the training views whose photographs vary most, since a small object is not in all; ours


@dataclass(frozen=True)
class Readability:
    """PSNR over all pixels of a few training views, dB: of the owner's extraction, and of negative controls.

    These are black, the photographs' mean colour, and an extraction with a wrong key.
    """

    message: float
    controls: dict[str, float]
    bits: ClassVar[bool] = False

    @property
    def readable(self) -> bool:
        """Whether the message stands out from all controls, by the margin of a present one."""
        return self.message >= max(self.controls.values()) + MARGIN

    def report(self) -> None:
        """Print the numbers, as a warning if the message is not readable."""
        best = max(self.controls, key=lambda name: self.controls[name])
        levels = (self.message, self.controls[best])
        texts = [percent(level / 100, 0) if self.bits else f"{decimal(level, 1)} dB" for level in levels]
        quantity = "correct bits" if self.bits else "message PSNR"
        numbers = f"{quantity} {texts[0]}; highest control {texts[1]} ({display_name(best)})"
        if self.readable:
            say(f"readable: yes ({numbers})")
        else:
            warn(f"readable: no ({numbers})")


class BitReadability(Readability):
    """Share of correct bits in a few training views, in percent; and the controls.

    These are the share that at most 1 % of unmarked images exceed, and that of a wrong key.
    """

    bits = True

    @property
    def readable(self) -> bool:
        """Whether more bits are correct than in all controls."""
        return self.message > max(self.controls.values())


def bit_readability(
    views: Sequence[Camera], public: PublicModel, key: Key, device: Device | None = None
) -> BitReadability:
    """Compare the bits in renders of a few training views, and negative controls."""
    scene = public.scene(device)
    images = [read_back(scene(camera)) for camera in views[:VIEWS]]

    def correct(of: Key) -> float:
        read = [as_bits(of.read_bits(image), len(of.bits)) for image in images]
        return share_correct(np.concatenate(read), np.tile(of.bits, len(images)))

    threshold = Threshold.of(len(key.bits), [], FALSE_POSITIVES)
    chance = 100.0 * (threshold.value / len(key.bits)) if threshold.rate <= FALSE_POSITIVES else 100.0
    return BitReadability(correct(key), {"chance": chance, WRONG_KEY: correct(wrong_key(key, 0))})


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
        MEAN_COLOUR: psnr(mean_colour(truth), truth),
        WRONG_KEY: quality(wrong_key(key, 0)),
    }
    return Readability(quality(key), controls)
