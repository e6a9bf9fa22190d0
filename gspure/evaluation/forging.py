"""What a forger without the owner's key reaches on a stranger's clean model.

He has a marked model of his own, its key and its message, and claims that the stranger's model holds this mark. The
judge tests the claim as `gspure.evaluation.judging` does, but has no clean models and asks for no commitment. Nothing
that a forger makes is written to files.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, UInt8
from gspure.attacks.strength import scene_renders
from gspure.cameras import Camera
from gspure.evaluation.evidence import Evidence
from gspure.evaluation.judging import proof_of
from gspure.images import is_blank, read_back
from gspure.metrics.bit_evidence import BitEvidence, bit_evidence
from gspure.metrics.damage import fidelity
from gspure.metrics.image_metrics import halved
from gspure.metrics.legibility import legibility
from gspure.metrics.proof import compared_views, traces
from gspure.metrics.readings import as_digits, bits_reading
from gspure.metrics.targets import BITS, MESSAGE, MODEL_BITS, is_picture
from gspure.opencl.device import Device
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.training.dataset import read_photographs

TWINS: Final = 8  # redrawn twins of a claim; ours


class Claim(NamedTuple):
    """A forgery, and what its judge finds."""

    forgery: str
    tries: int  # steps of training, or keys or messages tried
    read: float  # legible share of the picture, or share of correct bits, in percent; NaN if unknown
    p: float  # as published: without commitment and clean models
    fidelity: float  # PSNR in dB of the claimed model against the stranger's; infinite if it is his file
    is_late: bool  # whether the key is younger than the stranger's model, so that a commitment refuses it


@dataclass(frozen=True, eq=False)
class Forger:
    """A forger: a scheme, and what it made of his pair; and pictures of the message's kind.

    `candidates` [N,V,H/2,W/2,3] are the judge's, and `choices` [M,V,H/2,W/2,3] those among which the forger can choose
    a message, in the compared views of the message. Schemes of bits need none.
    """

    scheme: Scheme
    public: PublicModel
    key: Key
    pair: Pair
    candidates: UInt8
    choices: UInt8
    device: Device

    @property
    def hides_bits(self) -> bool:
        """Whether the message is bits, not a picture."""
        return not is_picture(next(iter(self.scheme.extractions)))

    @property
    def extractions(self) -> list[str]:
        """The extractions of a key that does not learn any more."""
        return [MESSAGE] if self.scheme.fits else [*filter(is_picture, self.scheme.extractions)]

    @cached_property
    def views(self) -> list[Camera]:
        """The held-out views of the message that a judge compares."""
        held_out = self.pair.message.dataset.test
        return [held_out[number] for number in compared_views(len(held_out))]

    def lesson(self, steps: int) -> Lesson:
        """Return the lesson of a key that is made for another model."""
        capture = self.pair.message
        return Lesson(capture.views, capture.images, (), steps, np.random.default_rng(0), device=self.device)


def forgeries(forger: Forger, stranger: PublicModel, steps: int, tries: int) -> Iterator[Claim]:
    """Yield the claim on the forger's own model, then those on a stranger's, after so many steps and tries."""
    yield Claim("own model", 0, *_judged(forger, forger.public, forger.key), inf, is_late=False)
    yield fitted(forger, stranger, steps)
    yield from copied(forger, stranger)
    yield from searched(forger, stranger, tries)


def fitted(forger: Forger, stranger: PublicModel, steps: int) -> Claim:
    """Return the claim by a key made for the stranger's model: it learned the message, or claims the bits it reads."""
    key = forger.key.forged(stranger, forger.lesson(steps))
    tries = 1 if forger.hides_bits else steps
    return Claim("fitted key", tries, *_judged(forger, stranger, key, chooses=True), inf, is_late=True)


def copied(forger: Forger, stranger: PublicModel) -> Iterator[Claim]:
    """Yield the claim by the forger's key on the stranger's model with a copy of his mark, if the scheme tells how."""
    framed = forger.scheme.copied(forger.public, stranger)
    if framed is None:
        return
    views = forger.pair.scene.dataset.test
    before, after = (scene_renders(public, views, forger.device) for public in (stranger, framed))
    yield Claim("copied mark", 1, *_judged(forger, framed, forger.key), fidelity(before, after), is_late=False)


def searched(forger: Forger, stranger: PublicModel, tries: int) -> Iterator[Claim]:
    """Yield the claim by the best of some keys, or of the picture that the forger's key shows best."""
    if forger.hides_bits:
        p = forger.key.forged(stranger, forger.lesson(1)).best_of(stranger, tries)
        if p is not None:
            yield Claim("searched key", tries, nan, p, inf, is_late=True)
        return
    shown = [_extractions(forger, stranger, forger.key, extraction) for extraction in forger.extractions]
    p = min(_p_value(forger, extractions, forger.choices) for extractions in shown)
    yield Claim("searched message", len(forger.choices), nan, p, inf, is_late=True)


def _judged(forger: Forger, public: PublicModel, key: Key, *, chooses: bool = False) -> tuple[float, float]:
    """Return how much a key reads of a message in a model, in percent, and the p-value of the best extraction.

    A message of bits may be chosen afterwards.
    """
    if forger.hides_bits:
        evidence = _bits(forger, public, key, chooses=chooses)
        return 100 * evidence.correct / evidence.bits, evidence.p
    message = read_photographs(forger.views)
    halves = np.stack([halved(picture) for picture in message])
    shown = [_extractions(forger, public, key, extraction) for extraction in forger.extractions]
    share = max(legibility(images, message) for images, *_ in shown)
    return 100 * share, min(_p_value(forger, extractions, halves[None]) for extractions in shown)


def _extractions(forger: Forger, public: PublicModel, key: Key, extraction: str) -> list[list[Float32]]:
    """Return what a key shows in the compared views: of a model, then of its redrawn twins."""
    twins = [forger.scheme.redrawn(public, np.random.default_rng(seed)) for seed in range(TWINS)]
    models = [public, *filter(None, twins)]
    return [[read_back(image) for image in key.images(model, extraction, forger.views)] for model in models]


def _p_value(forger: Forger, extractions: Sequence[Sequence[Float32]], choices: NDArray[Any]) -> float:
    """Return the p-value of the best of some messages [M,V,H/2,W/2,3], by extractions of a model and of its twins."""
    images = extractions[0]
    best = int(traces(images, choices).argmax())
    trace, *twins = (float(traces(shown, choices[best : best + 1])[0]) for shown in extractions)
    of_candidates = tuple(traces(images, forger.candidates).tolist())
    return proof_of(Evidence(trace, nan, of_candidates, tuple(twins), all(map(is_blank, images))), ()).p


def _bits(forger: Forger, public: PublicModel, key: Key, *, chooses: bool) -> BitEvidence:
    """Return the evidence for the key's message, or for the bits that the forger chooses: those that are read most."""
    if MODEL_BITS in forger.scheme.extractions:
        readings = key.model_readings(public)
    else:
        scene = public.scene(forger.device)
        views = forger.pair.scene.dataset.test
        readings = [bits_reading(BITS, key.read_bits(read_back(scene(view))), key.bits) for view in views]
    if not chooses:
        return bit_evidence(readings, as_digits(key.bits))
    columns = zip(*(reading.decoded for reading in readings), strict=True)
    return bit_evidence(readings, "".join(max("01", key=column.count) for column in columns))
