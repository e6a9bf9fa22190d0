"""Bits that two schemes hide in a scene, read from its renders after the image attacks of config/severity.yaml.

pip install ./examples/marked_clones
gspure pair room vault --views 24 --width 160 --height 120 --out pair
python -m experiments.image pair experiments/tables/image-attacks.csv
"""

import argparse
import csv
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import Float32
from gspure.attacks import Attack, find_attack
from gspure.images import read_back
from gspure.metrics.image_metrics import psnr
from gspure.schemes.pair import Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Key, hide
from gspure.training.dataset import read_photographs
from gspure.workflow.config_reading import read_config

SCHEMES: dict[str, dict[str, Any]] = {"marked_clones": {"decoder_steps": 600}, "rendered_bits": {}}
SETTINGS: dict[str, Any] = {"iterations": 1000, "max_gaussians": 8000}
SEVERITY = Path(__file__).parents[1] / "config" / "severity.yaml"
Row = tuple[str, str, float, float, float]


def image_attacks() -> Iterator[tuple[Attack, Mapping[str, Any]]]:
    """Yield the attack and its settings for each variant that attacks renders."""
    for name, variant in read_config([SEVERITY], {}, str(SEVERITY)).variants.items():
        attack = find_attack(variant.attack or name)
        if attack.of_renders:
            yield attack, variant.settings


def measured(pair: Pair, scheme: str) -> Iterator[Row]:
    """Yield the rows of a scheme: attack, strength, PSNR of the scene, correct bits of both kinds of views in %."""
    begin = time.process_time()
    public, key = hide(find_scheme(scheme), pair, **SETTINGS, **SCHEMES[scheme])
    assert key
    print(f"{scheme}: {time.process_time() - begin:.0f} CPU-s")
    clean, _ = hide(find_scheme(scheme), pair, message_weight=0, **SETTINGS)
    views = [*pair.scene.views, *pair.scene.dataset.test]
    renders = [read_back(public.scene()(view)) for view in views]
    unmarked = [read_back(clean.scene()(view)) for view in views]
    fidelity = np.mean([psnr(render, reference) for render, reference in zip(renders, unmarked, strict=True)])
    print(f"{scheme}: renders have {fidelity:.1f} dB against those of the clean model")
    count = len(pair.scene.views)  # of training views; held-out ones follow
    photographs = read_photographs(pair.scene.dataset.test)

    def row(attack: str, strength: str, images: Sequence[Float32], key: Key = key) -> Row:
        held_out = zip(images[count:], photographs, strict=True)
        quality = np.mean([psnr(image, photograph) for image, photograph in held_out])
        correct = np.array([100 * np.mean(key.read_bits(image) == key.bits) for image in images])
        return attack, strength, float(quality), float(correct[:count].mean()), float(correct[count:].mean())

    yield row("clean model", "", unmarked)
    yield row("wrong key", "", renders, key.wrong(np.random.default_rng(1)))
    yield row("unattacked", "", renders)
    for attack, settings in image_attacks():
        retouched = attack.apply(public, **settings).retouched
        images = [retouched(image, view.name) for image, view in zip(renders, views, strict=True)]
        ((name, value),) = settings.items()
        yield row(attack.name, f"{name} {value:g}", images)


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pair", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    pair = read_pair(args.pair)
    tables = [[*measured(pair, scheme)] for scheme in SCHEMES]
    measures = ("scene PSNR, dB", "correct bits, training views, %", "held-out views, %")
    with args.out.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        columns = [f"{scheme}: {measure}" for scheme in SCHEMES for measure in measures]
        writer.writerow(["attack", "strength", *columns])
        for rows in zip(*tables, strict=True):
            attack, strength = rows[0][:2]
            values = [f"{value:.1f}" for row in rows for value in row[2:]]
            writer.writerow([attack, strength, *values])


if __name__ == "__main__":
    main()
