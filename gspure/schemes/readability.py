"""Whether an owner can read the message that was just embedded, beside negative controls."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.images import mean_colour, write_image
from gspure.metrics.detection import Threshold
from gspure.metrics.image_metrics import MARGIN, psnr
from gspure.metrics.names import BLACK, MEAN_COLOUR, WRONG_KEY, display_name
from gspure.metrics.readings import Reading
from gspure.metrics.retrieval import FALSE_POSITIVES
from gspure.metrics.targets import MESSAGE
from gspure.opencl.device import Device
from gspure.progress import say, warn
from gspure.public_model import PublicModel
from gspure.schemes.pair import Capture
from gspure.schemes.scheme import Key
from gspure.text import decimal, percent

BY_CHANCE: Final = "chance"
VIEWS: Final = 4  # number of training views; ours


@dataclass(frozen=True)
class Readability:
    """The quality of the message in a few training views, as its owner reads it, and that of negative controls.

    For a picture, it is the PSNR over all pixels, dB; controls are black, the photographs' mean colour, and an
    extraction with a wrong key. For bits, it is the share of correct ones, in percent; controls are the share that at
    most 1 % of unmarked images exceed, and that of a wrong key.
    """

    message: float
    controls: dict[str, float]
    readable: bool  # whether the message stands out from all controls

    def report(self) -> None:
        """Print the numbers, as a warning if the message is not readable."""
        best = max(self.controls, key=lambda name: self.controls[name])
        gap = self.message - self.controls[best]
        if BY_CHANCE in self.controls:
            quantity = "correct bits"
            level = percent(self.message / 100, 0)
            distance = percent(abs(gap) / 100, 0)
        else:
            quantity = "message PSNR"
            level = f"{decimal(self.message, 1)} dB"
            distance = f"{decimal(abs(gap), 1)} dB"
        direction = "above" if gap > 0 else "below"
        numbers = f"{quantity} {level}, {distance} {direction} the highest control, {display_name(best)}"
        if self.readable:
            say(f"readable: yes ({numbers})")
        else:
            warn(f"readable: no ({numbers})")


def bit_readability(
    views: Sequence[Camera], public: PublicModel, key: Key, device: Device | None = None
) -> Readability:
    """Compare the bits in renders of a few training views, and negative controls."""
    scene = public.scene(device)
    with TemporaryDirectory() as folder:
        for number, camera in enumerate(views[:VIEWS]):
            write_image(Path(folder, f"{number}.png"), scene(camera))
        return _of_bits(key, lambda reader: reader.readings(Path(folder)))


def model_bit_readability(public: PublicModel, key: Key) -> Readability:
    """Compare the bits in the rows of the public model, and negative controls."""
    return _of_bits(key, lambda reader: reader.model_readings(public))


def _of_bits(key: Key, read: Callable[[Key], list[Reading]]) -> Readability:
    """Compare the bits that a key reads with chance, and with those that a wrong key reads."""
    threshold = Threshold.at_rate(FALSE_POSITIVES, len(key.bits))
    chance = 100.0 * (threshold.value / len(key.bits)) if threshold.rate <= FALSE_POSITIVES else 100.0

    def share_correct(reader: Key) -> float:
        """Return the share of the bits that a key reads correctly, in percent."""
        readings = read(reader)
        correct = sum(reading.value for reading in readings)
        return 100.0 * (correct / (len(readings) * len(reader.bits)))

    message = share_correct(key)
    controls = {BY_CHANCE: chance, WRONG_KEY: share_correct(key.wrong(np.random.default_rng(0)))}
    return Readability(message, controls, message > max(controls.values()))


def readability(capture: Capture, public: PublicModel, key: Key, device: Device | None = None) -> Readability:
    """Compare the message, and its negative controls, with the photographs of a few training views.

    These views vary most, since a small object is not in all of them.
    """
    chosen = sorted(range(len(capture.images)), key=lambda view: -capture.images[view].std())[:VIEWS]
    truth = np.concatenate([capture.images[view].reshape(-1, 3) for view in chosen])

    def quality(reader: Key) -> float:
        """Return the PSNR of what a key shows in these views, dB."""
        images = reader.images(public, MESSAGE, [capture.views[view] for view in chosen], device)
        return psnr(np.concatenate([image.clip(0, 1).reshape(-1, 3) for image in images]), truth)

    controls = {
        BLACK: psnr(np.zeros_like(truth), truth),
        MEAN_COLOUR: psnr(mean_colour(truth), truth),
        WRONG_KEY: quality(key.wrong(np.random.default_rng(0))),
    }
    message = quality(key)
    return Readability(message, controls, message >= max(controls.values()) + MARGIN)
