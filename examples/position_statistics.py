"""An example of a detector that reads a model's file: bits in a statistic of the positions of its Gaussians.

    python position_statistics.py embed --key 7 --bits 0110100110010110 model.ply marked.ply
    python position_statistics.py detect --key 7 --count 16 marked.ply        # JSON: the bits of the model

A keyed hash of the cell of y and z assigns each Gaussian to a bit. For a 1, x is rounded to whole steps, for a 0 to
half ones; the sign of the mean of cos(2 pi x / STEP) over the Gaussians of a bit tells which, also after small noise.
"""

import argparse
import json

import numpy as np
from plyfile import PlyData

STEP = 0.002  # world units; x moves by at most half of it
CELL = 0.05


def assigned(vertices, key, count):
    """Return the index of the bit of each Gaussian."""
    cells = np.floor(np.stack([vertices["y"], vertices["z"]], axis=1) / CELL).astype(np.int64)
    multipliers = np.random.default_rng(key).integers(1 << 62, size=2) | 1
    return ((cells * multipliers).sum(axis=1) >> 33) % count


def marked(vertices, key, bits):
    """Return x of the Gaussians with the mark."""
    offsets = np.where(bits, 0.0, 0.5)[assigned(vertices, key, len(bits))]
    return STEP * (np.round(vertices["x"] / STEP - offsets) + offsets)


def read(vertices, key, count):
    """Return the bits."""
    cosines = np.cos(2 * np.pi * vertices["x"].astype(np.float64) / STEP)
    return np.bincount(assigned(vertices, key, count), cosines, count) > 0


def main():
    """Embed, or detect and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    embed = commands.add_parser("embed")
    detect = commands.add_parser("detect")
    for command in (embed, detect):
        command.add_argument("--key", type=int, required=True)
        command.add_argument("model")
    embed.add_argument("out")
    embed.add_argument("--bits", required=True, help="such as 0110")
    detect.add_argument("--count", type=int, required=True, help="number of bits")
    args = parser.parse_args()
    model = PlyData.read(args.model)
    vertices = model["vertex"].data
    if args.command == "embed":
        vertices["x"] = marked(vertices, args.key, np.array([*args.bits]) == "1")
        model.write(args.out)
    else:
        bits = read(vertices, args.key, args.count)
        print(json.dumps({"model": "".join("1" if bit else "0" for bit in bits)}))


if __name__ == "__main__":
    main()
