"""An example of a detector: a spread-spectrum watermark, embedded in photographs and read from renders.

    python spread_spectrum.py embed --key 7 photographs marked        # then train on the marked photographs
    python spread_spectrum.py detect --key 7 renders                  # JSON: a score for each image
    python spread_spectrum.py embed --key 7 --bits 0110100110010110 photographs marked
    python spread_spectrum.py detect --key 7 --count 16 renders       # JSON: 16 bits for each image

Every photograph gets the same pseudo-random pattern or, with --bits, the sum of one pattern per bit: added for 1,
subtracted for 0.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from PIL import Image

BAND = 0.04, 0.2
"""Frequencies of the patterns, cycles per pixel: a scene has most power below them, and training blurs above."""

SMALLEST = 16
"""Least width and height in pixels: smaller images have too few frequencies in the band for a pattern."""


def in_band(shape):
    """Return the mask [H,W/2+1] of the frequencies of an image that are in the band."""
    radius = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    return (radius >= BAND[0]) & (radius <= BAND[1])


def patterns(key, count, shape):
    """Return patterns [N,H,W] of root mean square 1."""
    noise = np.fft.rfft2(np.random.default_rng(key).normal(size=(count, *shape)))
    pattern = np.fft.irfft2(noise * in_band(shape), shape)
    return pattern / pattern.std(axis=(1, 2), keepdims=True)


def marked(photograph, key, bits, strength):
    """Return a photograph [H,W,3] in 0 .. 255 with the mark; `strength` is its root mean square."""
    signs = np.where(np.array([*bits]) == "1", 1.0, -1.0)
    mark = np.tensordot(signs, patterns(key, len(bits), photograph.shape[:2]), 1)
    return np.clip(photograph + strength * (mark / mark.std())[..., None], 0, 255)


def correlations(image, key, count):
    """Return the correlation [N] of an image [H,W,3] with each pattern: standard normal if it has no mark.

    Weak noise, other than that of the patterns, makes this true of flat images, too.
    """
    noise = np.random.default_rng([key, 1]).normal(scale=1e-3, size=image.shape[:2])
    spectrum = np.fft.rfft2(image.mean(axis=2) + noise)
    inside = in_band(image.shape[:2])
    phases = np.where(inside, spectrum / np.maximum(np.abs(spectrum), 1e-9), 0)  # else strong edges outweigh the mark
    white = np.fft.irfft2(phases, image.shape[:2])
    products = np.mean(white * patterns(key, count, white.shape), axis=(1, 2))
    return products / white.std() * np.sqrt(2 * np.count_nonzero(inside))


def natural(text):
    """Return the whole number, 0 or more, that a text spells."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected a whole number, 0 or more, found {text!r}")
    return int(text)


def main():
    """Embed, or detect and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    embed = commands.add_parser("embed")
    detect = commands.add_parser("detect")
    for command in (embed, detect):
        command.add_argument("--key", type=natural, required=True)
        command.add_argument("images", type=Path)
    embed.add_argument("out", type=Path)
    embed.add_argument("--bits", default="1", help="such as 0110 (default: a mark without bits)")
    embed.add_argument("--strength", type=float, default=4.0, help="of 255 (default: %(default)g)")
    detect.add_argument("--count", type=natural, default=0, help="number of bits (default: a score)")
    args = parser.parse_args()

    images = {}
    for path in sorted(args.images.glob("*.png")):
        try:
            images[path] = np.asarray(Image.open(path).convert("RGB"), float)
        except (OSError, SyntaxError, ValueError) as error:
            parser.error(f"{path}: {error}")
    if not images:
        parser.error(f"{args.images}: expected PNG files, found none")
    for path, image in images.items():
        height, width, _ = image.shape
        if min(height, width) < SMALLEST:
            parser.error(f"{path}: expected at least {SMALLEST}x{SMALLEST} pixels, found {width}x{height}")
    if args.command == "embed":
        if {*args.bits} - {*"01"} or not args.bits or not 0 < args.strength <= 255:
            parser.error("expected --bits of 0 and 1, and a --strength above 0, at most 255")
        if args.out.exists():
            parser.error(f"{args.out}: expected a new folder, found one of this name")
        args.out.mkdir(parents=True)
        for path, image in images.items():
            pixels = np.rint(marked(image, args.key, args.bits, args.strength)).astype(np.uint8)
            Image.fromarray(pixels).save(args.out / path.name)
    else:
        readings = {path.stem: correlations(image, args.key, max(args.count, 1)) for path, image in images.items()}
        bits = {view: "".join("1" if value > 0 else "0" for value in values) for view, values in readings.items()}
        print(json.dumps(bits if args.count else {view: float(values[0]) for view, values in readings.items()}))


if __name__ == "__main__":
    main()
