"""Whether an owner can read the message that was just embedded, beside negative controls."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.images import write_image
from gspure.metrics import legibility
from gspure.metrics.detection import FALSE_POSITIVES, Threshold
from gspure.metrics.image_metrics import psnr
from gspure.metrics.names import WRONG_KEY, display_name
from gspure.metrics.proof import trace
from gspure.metrics.readings import Reading
from gspure.metrics.targets import BITS, MESSAGE, MODEL_BITS
from gspure.opencl.device import Device
from gspure.progress import say, warn
from gspure.public_model import PublicModel
from gspure.schemes.pair import Capture, Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.text import decimal, percent

BY_CHANCE: Final = "chance"
VIEWS: Final = 4  # number of training views; ours


@dataclass(frozen=True)
class Readability:
    """How much of the message its owner reads in a few training views, and how much a wrong key shows.

    It is the legible share of a picture's blocks, or the share of correct bits, in percent. Bits must also exceed the
    share that at most 1 % of unmarked images do.
    """

    message: float
    controls: dict[str, float]
    readable: bool  # whether the message can be read, and stands out from all controls
    quantity: str
    psnr: float = nan  # of a picture, dB

    def report(self) -> None:
        """Print the numbers, as a warning if the message is not readable."""
        others = [f"{display_name(name)} {percent(share / 100, 0)}" for name, share in self.controls.items()]
        quality = "" if isnan(self.psnr) else f", PSNR {decimal(self.psnr, 1)} dB"
        numbers = f"{self.quantity} {percent(self.message / 100, 0)}{quality}; {', '.join(others)}"
        if self.readable:
            say(f"readable: yes ({numbers})")
        else:
            warn(f"readable: no ({numbers})")


def readability_of(
    scheme: Scheme, pair: Pair, public: PublicModel, key: Key, device: Device | None = None
) -> Readability:
    """Return how much of its message a key reads in a model: a picture, or bits of renders or of the file."""
    if BITS in scheme.extractions:
        return bit_readability(pair.scene.views, public, key, device)
    if MODEL_BITS in scheme.extractions:
        return model_bit_readability(public, key)
    return readability(pair.message, public, key, device)


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
    return Readability(message, controls, message > max(controls.values()), "correct bits")


def readability(capture: Capture, public: PublicModel, key: Key, device: Device | None = None) -> Readability:
    """Compare the message, and its negative controls, with the photographs of a few training views.

    These views vary most, since a small object is not in all of them.
    """
    chosen = sorted(range(len(capture.images)), key=lambda view: -capture.images[view].std())[:VIEWS]
    truths = [capture.images[view] for view in chosen]

    def shown(reader: Key) -> list[Float32]:
        """Return what a key shows in these views."""
        views = [capture.views[view] for view in chosen]
        return [image.clip(0, 1) for image in reader.images(public, MESSAGE, views, device)]

    extractions = shown(key)
    with_wrong_key = shown(key.wrong(np.random.default_rng(0)))
    message = 100.0 * legibility.legibility(extractions, truths)
    stands_out = trace(extractions, truths) > trace(with_wrong_key, truths)  # edges alone may be legible with both
    return Readability(
        message=message,
        controls={WRONG_KEY: 100.0 * legibility.legibility(with_wrong_key, truths)},
        readable=message >= 100.0 * legibility.READABLE and stands_out,
        quantity="legible",
        psnr=psnr(np.concatenate([*map(_pixels, extractions)]), np.concatenate([*map(_pixels, truths)])),
    )


def _pixels(image: Float32) -> Float32:
    return image.reshape(-1, 3)
