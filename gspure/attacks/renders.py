"""Attacks on renders of the scene, for marks that are read from images; the model itself is published unchanged.

Each is a function from an image [H,W,3], 0 to 1, to an image of the same size, which is clipped later. Strengths are
those of WAVES (An et al. 2024, arXiv 2401.08573) for images of 512x512 pixels: JPEG of quality 90 to 10, blurs of up to
20 pixels, crops to half of the area, noise of up to 0.1, brightness of up to 2. `resize` and `median` are ours.

Attacks that train on renders can retouch these first (`retouch`).
"""

import io
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np

from gspure.arrays import Float32
from gspure.attacks.attack import Attack, Rng
from gspure.attacks.attacked import Retouch
from gspure.attacks.strength import Strength
from gspure.errors import InputError
from gspure.images import levels
from gspure.settings import Amount, Range, parsed_settings

if TYPE_CHECKING:
    from PIL.Image import Image

PART: Final = Range(0.01, 1.0)  # of an image

Part = Annotated[float, PART]


def jpeg(image: Float32, _rng: Rng, *, quality: Annotated[int, Range(1, 100)] = 50) -> Float32:
    """Compress renders as JPEG of a `quality`.

    Source: WAVES (arXiv 2401.08573), with 90 to 10.
    """
    from PIL import Image

    stream = io.BytesIO()
    _picture(image).save(stream, "JPEG", quality=quality)
    return _array(Image.open(stream))


def blur(image: Float32, _rng: Rng, *, radius: Annotated[float, Range(0.0, 1000.0)] = 2.0) -> Float32:
    """Blur renders by a Gaussian with a standard deviation of `radius` pixels.

    Source: WAVES (arXiv 2401.08573), with up to 20 pixels of 512.
    """
    from PIL import ImageFilter

    return _array(_picture(image).filter(ImageFilter.GaussianBlur(radius)))


def median(image: Float32, _rng: Rng, *, radius: Annotated[int, Range(0, 50)] = 1) -> Float32:
    """Replace every channel of a pixel by the median of the square of 2 `radius` + 1 pixels around it.

    Source: ours.
    """
    from PIL import ImageFilter

    return _array(_picture(image).filter(ImageFilter.MedianFilter(2 * radius + 1)))


def resized_crop(image: Float32, rng: Rng, *, area: Part = 0.7) -> Float32:
    """Enlarge a random window with a share `area` of the pixels to the size of the render.

    Source: WAVES (arXiv 2401.08573), with shares down to 0.5.
    """
    height, width = image.shape[:2]
    side = np.sqrt(area)  # of the window, relative to the render
    left, top = rng.random(2) * (1 - side) * np.array([width, height])
    box = (left, top, left + width * side, top + height * side)
    picture = _picture(image)
    return _array(_resized(picture, picture.size, box))


def resize(image: Float32, _rng: Rng, *, scale: Part = 0.5) -> Float32:
    """Reduce width and height of renders by the factor `scale`, and enlarge them again.

    Source: what editors and converters do.
    """
    picture = _picture(image)
    small = [max(round(scale * side), 1) for side in picture.size]
    return _array(_resized(_resized(picture, small), picture.size))


def pixel_noise(image: Float32, rng: Rng, *, sigma: Amount = 0.05) -> Float32:
    """Add Gaussian noise of standard deviation `sigma`, of a range of 0 to 1, to renders.

    Source: WAVES (arXiv 2401.08573), with up to 0.1.
    """
    return image + np.float32(sigma) * rng.standard_normal(image.shape, np.float32)


def brightness(image: Float32, _rng: Rng, *, factor: Amount = 1.5) -> Float32:
    """Multiply renders by `factor`.

    Source: WAVES (arXiv 2401.08573), with up to 2.
    """
    return image * np.float32(factor)


def _resized(picture: "Image", size: Sequence[int], box: tuple[float, float, float, float] | None = None) -> "Image":
    from PIL.Image import Resampling

    return picture.resize((size[0], size[1]), Resampling.BICUBIC, box)


def _picture(image: Float32) -> "Image":
    from PIL import Image

    return Image.fromarray(levels(image))


def _array(picture: "Image") -> Float32:
    return np.asarray(picture, np.float32) / np.float32(255)


_STRENGTHS: Final[dict[Callable[..., Float32], Strength]] = {
    jpeg: Strength("quality", 100, 1),
    blur: Strength("radius", 0.1, 100.0, "log"),
    median: Strength("radius", 0, 20),
    resized_crop: Strength("area", 1.0, 0.01),
    resize: Strength("scale", 1.0, 0.01),
    pixel_noise: Strength("sigma", 1e-3, 1.0, "log"),
    brightness: Strength("factor", 1.01, 10.0, "log"),
}
ATTACKS = tuple(
    Attack(function.__name__, function, strength=strength, of_renders=True) for function, strength in _STRENGTHS.items()
)


def retouch(text: str, seed: int) -> Retouch:
    """Return what changes a render and the name of its view as a text such as ``jpeg:50`` says: attack and strength.

    Raise `InputError` if there is no such attack on renders, or no such strength of it.
    """
    name, _, value = text.partition(":")
    known = {attack.name: (attack, strength) for attack, strength in zip(ATTACKS, _STRENGTHS.values(), strict=True)}
    if name not in known:
        raise InputError("render", "attack", expected=f"one of {', '.join(known)}", found=repr(name))
    attack, strength = known[name]
    settings = parsed_settings(f"render {name}", attack.function, {strength.setting: value} if value else {})
    return partial(attack.retouched, seed=seed, settings=settings)
