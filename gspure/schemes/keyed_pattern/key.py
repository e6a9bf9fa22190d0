"""The key.

::

    <key>/keyed_pattern.npz   the secret and the message
    <key>/clean.ply           the clean model, whose digest the pattern depends on
    <key>/cameras.json        views to compare
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, Final, NamedTuple

import numpy as np

from gspure.arrays import Bools, Float32, Float64, Kind, UInt8, load_arrays, save_arrays
from gspure.cameras import Camera, read_cameras, write_cameras
from gspure.errors import InputError
from gspure.images import png_files, read_image
from gspure.metrics.proof import rank_p
from gspure.metrics.readings import MODEL, Reading, bits_reading
from gspure.metrics.sign_ranks import KEYS, Certificate, certificate, largest_sums
from gspure.model import Gaussians, read_model, write_model
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.keyed_pattern.pattern import Cells, Grid, Pattern, marked
from gspure.schemes.keyed_pattern.registration import placements
from gspure.schemes.keyed_pattern.residuals import blind, colour_mapped, informed, renders, smoothed, whitened
from gspure.schemes.scheme import Key

FILE: Final = "keyed_pattern.npz"
CLEAN: Final = "clean.ply"
CAMERAS: Final = "cameras.json"
SECRET: Final = 32  # bytes
ARRAYS: Final[dict[str, Kind]] = {"secret": (np.uint8, (SECRET,)), "bits": (np.bool_, (None,))}

FORGED: Final = 0.005  # strength of a forger's mark, of colours 0 to 1; ours

SMOOTHED: Final = ((0.01, 1), (0.01, 3), (0.02, 3), (0.04, 3))
"""Clip and passes of the attack ``unmark`` on the clean model: the owner's further references; ours."""


class Findings(NamedTuple):
    """What a suspect shows in the cells of a grid, tried in several ways, without a key."""

    cells: Cells  # [C]
    tries: Float64  # [T,C,3], each of norm 1: a sum with random signs is a standard score


class KeyedPatternKey(Key):
    """The private part of the scheme: secret [32], bits [N], the clean model, and views to compare."""

    bank: ClassVar[Sequence[tuple[float, int]]] = SMOOTHED

    def __init__(self, secret: UInt8, bits: Bools, clean: Gaussians, views: Sequence[Camera]) -> None:
        self.secret = secret
        self.bits = bits
        self.clean = clean
        self.views = views

    @cached_property
    def grid(self) -> Grid:
        """The grid of the clean model."""
        return Grid.of(self.clean)

    @cached_property
    def pattern(self) -> Pattern:
        """The pattern of the secret for the clean model."""
        with TemporaryDirectory() as folder:
            file = Path(folder, CLEAN)
            write_model(file, self.clean)
            clean_digest = sha256(file.read_bytes()).digest()
        return Pattern.of(self.secret.tobytes(), clean_digest, self.bits)

    @cached_property
    def references(self) -> list[Float32]:
        """The renders of the clean model, and of what ``unmark`` makes of it."""
        models = [self.clean, *(smoothed(self.clean, self.grid, clip, passes) for clip, passes in self.bank)]
        return [renders(model, self.views) for model in models]

    def findings(self, public: PublicModel) -> Findings:
        """Return what a public or attacked model shows, from its rows and its renders.

        A model that was moved is moved back first, to where its renders resemble those of the clean model most.
        """
        placed = [(model, renders(model, self.views)) for model in placements(public, self.clean)]
        model, images = min(placed, key=lambda place: float(np.abs(place[1] - self.references[0]).mean()))
        return _united(blind(model, self.grid), self._informed(images, self.views))

    def findings_in(self, images: Float32, views: Sequence[Camera]) -> Findings:
        """Return what renders [V,H,W,3] of some of the key's views show together."""
        cells, values = self._informed(images, views)
        return _united((cells, values[0]), (cells, values[1:]))

    def _informed(self, images: Float32, views: Sequence[Camera]) -> tuple[Cells, Float64]:
        """Return what renders show in the cells of the clean model, against each of the references."""
        places = [self.views.index(view) for view in views]
        references = [reference[places] for reference in self.references]
        mapped = colour_mapped(images, references)
        residuals = [whitened(image - reference) for image, reference in zip(mapped, references, strict=True)]
        return informed(self.clean, self.grid, views, residuals)

    def decoded(self, findings: Findings) -> Bools:
        """Return the bits [N] that the clearest of the tries shows."""
        signs, owners = self.pattern.signs(findings.cells)
        by_try: list[Float64] = [np.zeros(len(self.bits))]  # if nothing differs from the clean model
        by_try += [
            np.bincount(owners.ravel(), (values * signs).ravel(), len(self.bits)).astype(np.float64)
            for values in findings.tries
        ]
        clearest = max(by_try, key=lambda sums: float(np.abs(sums).sum()))
        return np.asarray(clearest > 0)

    def certificate(self, findings: Findings, keys: int = KEYS) -> Certificate:
        """Return the rank of the pattern, with its message, among those of other keys."""
        mark = self.pattern.mark(findings.cells).ravel()
        return certificate(findings.tries.reshape(len(findings.tries), -1), mark, keys)

    def read_model_bits(self, public: PublicModel) -> Bools:
        """Return the bits [N] that a public or attacked model shows."""
        return self.decoded(self.findings(public))

    def model_readings(self, public: PublicModel) -> list[Reading]:
        """Return the bits that a model shows, and their p-value by rank among `KEYS` other keys."""
        return [self.certified(public, KEYS)]

    def certified(self, public: PublicModel, keys: int) -> Reading:
        """Return the bits that a model shows, and their p-value by rank among other keys."""
        return self._reading(self.findings(public), keys)

    def readings(self, images: Path) -> list[Reading]:
        """Return the bits that renders of the key's views show together, by name, and their p-value."""
        files = {path.stem: path for path in png_files(images)}
        views = [view for view in self.views if view.name in files]
        if not views:
            expected = f"renders of {', '.join(view.name for view in self.views)}"
            raise InputError(images, "images", expected=expected, found=", ".join(files))
        pictures = np.stack([read_image(files[view.name], (view.width, view.height)) for view in views])
        return [self._reading(self.findings_in(pictures, views), KEYS)]

    def _reading(self, findings: Findings, keys: int) -> Reading:
        reading = bits_reading(MODEL, self.decoded(findings), self.bits)
        return reading._replace(p=self.certificate(findings, keys).p)

    def forged(self, public: PublicModel, lesson: Lesson) -> KeyedPatternKey:
        """Return a forged key, whose claimed clean model is the stranger's minus a random mark.

        The claimed message is what this key then reads in the stranger's model.
        """
        draft = self.random(lesson.rng, len(self.bits), public.model, self.views)
        clean = marked(public.model, draft.grid, draft.pattern, -FORGED)
        forged = KeyedPatternKey(draft.secret, draft.bits, clean, draft.views)
        return KeyedPatternKey(draft.secret, forged.read_model_bits(public), clean, draft.views)

    def best_of(self, public: PublicModel, keys: int) -> float:
        """Return the p-value of the best of some random keys, by rank among `KEYS` others."""
        findings = self.findings(public)
        tries = findings.tries.reshape(len(findings.tries), -1)
        return rank_p(float(largest_sums(tries, keys).max()), largest_sums(tries, KEYS))

    def wrong(self, rng: np.random.Generator) -> KeyedPatternKey:
        """Return another secret and message for the same clean model."""
        return KeyedPatternKey(*_drawn(rng, len(self.bits)), self.clean, self.views)

    def write(self, folder: Path) -> None:
        """Write the three files."""
        save_arrays(folder / FILE, {"secret": self.secret, "bits": self.bits})
        write_model(folder / CLEAN, self.clean)
        write_cameras(folder / CAMERAS, self.views)

    @staticmethod
    def read(folder: Path) -> KeyedPatternKey:
        """Read a key, or raise `InputError`."""
        arrays = load_arrays(Path(folder) / FILE, ARRAYS, "a key of keyed patterns")
        clean = read_model(Path(folder) / CLEAN)
        return KeyedPatternKey(arrays["secret"], arrays["bits"], clean, read_cameras(Path(folder) / CAMERAS))

    @classmethod
    def random(cls, rng: np.random.Generator, bits: int, clean: Gaussians, views: Sequence[Camera]) -> KeyedPatternKey:
        """Return a random key to some bits."""
        return cls(*_drawn(rng, bits), clean, [replace(view, image=None) for view in views])


def _drawn(rng: np.random.Generator, bits: int) -> tuple[UInt8, Bools]:
    return rng.integers(256, size=SECRET, dtype=np.uint8), rng.random(bits) < 0.5


def _united(first: tuple[Cells, Float64], others: tuple[Cells, Float64]) -> Findings:
    """Return the values of one try [C,3] and of others [T,C',3], of other cells, by cell."""
    cells = np.union1d(first[0], others[0])
    tries = np.zeros((1 + len(others[1]), len(cells), 3))
    tries[0, np.searchsorted(cells, first[0])] = first[1]
    tries[1:, np.searchsorted(cells, others[0])] = others[1]
    norms = np.sqrt(np.square(tries).sum(axis=(1, 2), keepdims=True))
    shows = norms.ravel() > 0
    return Findings(cells, tries[shows] / norms[shows])
