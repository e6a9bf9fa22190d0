"""The interface of a watermarking scheme: training, public model, key, extraction."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.cameras.camera import Camera
from gspure.constants import TAU_C, TAU_N
from gspure.errors import InputError
from gspure.metrics.readings import MODEL, Reading, bits_reading, read_bits
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.public_model import Lesson, PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.carriers import permuted, transplanted
from gspure.schemes.pair import Pair
from gspure.settings import SCHEDULES, SEED, Setting, defaults, require_settings

FIT_STEPS: Final = 300  # of a decoder, or of private networks, on an attacked model (`Key.fitted`); ours


class Key(ABC):
    """The private part of a scheme; its owner needs it to extract the message."""

    @abstractmethod
    def write(self, folder: Path) -> None:
        """Write the key's files."""

    bits: Bools = np.zeros(0, np.bool_)  # the message [N] of a scheme that hides bits

    def read_bits(self, image: Float32) -> Bools:  # noqa: ARG002
        """Return the bits [N] that an image [H,W,3] of the scene shows, 0 to 1."""
        hint = "`gspure extract` renders pictures, `gspure detect MODEL` reads files"
        raise InputError("key", "message", expected="bits that images show", found="none", hint=hint)

    def read_model_bits(self, public: PublicModel) -> Bools:  # noqa: ARG002
        """Return the bits [N] that the rows of a public or attacked model hold."""
        hint = "`gspure extract` renders pictures, `gspure detect IMAGES` reads renders"
        raise InputError("key", "message", expected="bits that a file holds", found="none", hint=hint)

    def model_readings(self, public: PublicModel) -> list[Reading]:
        """Return the bits that a model holds, compared with the message."""
        return [bits_reading(MODEL, self.read_model_bits(public), self.bits)]

    def certified(self, public: PublicModel, keys: int) -> Reading:  # noqa: ARG002
        """Return the bits that a model holds, and their p-value by rank among so many other keys."""
        raise InputError("key", "--certify", expected="a keyed pattern", found="a key of another kind")

    def readings(self, images: Path) -> list[Reading]:
        """Return the bits that each PNG file of a folder shows, compared with the message."""
        return read_bits(self.read_bits, self.bits, images)

    def revealed(self, public: PublicModel, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians that show the message in any view, and the row of the model for each."""
        raise InputError("key", "message", expected="a picture", found="bits", hint="`gspure detect --key` reads them")

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        """Return the renderer of the message: that of the `revealed` Gaussians, unless these depend on the view."""
        return Renderer(self.revealed(public, extraction)[0], device).image

    def images(
        self, public: PublicModel, extraction: str, views: Sequence[Camera], device: Device | None = None
    ) -> Iterator[Float32]:
        """Yield the message [H,W,3] in each of the views."""
        return map(self.message(public, extraction, device), views)

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians whose blending shows the message to a camera, and the row of the model for each."""
        return self.revealed(public, extraction)

    def fitted(self, public: PublicModel, lesson: Lesson) -> Key:  # noqa: ARG002
        """Return the key after learning from photographs of the message, for an attacked model: see `Scheme.fits`."""
        return self

    def forged(self, public: PublicModel, lesson: Lesson) -> Key:
        """Return a forger's key for a stranger's clean model, in which it shows the lesson.

        A key of bits claims as its message the bits that it reads there. See `gspure.evaluation.forging`. By default,
        the key learns as that of an owner who adapts.
        """
        return self.fitted(public, lesson)

    def best_of(self, public: PublicModel, keys: int) -> float | None:  # noqa: ARG002
        """Return the p-value, by rank, of the best of some random keys for a model; None without such ranks."""
        return None

    @abstractmethod
    def wrong(self, rng: np.random.Generator) -> Key:
        """Return an unrelated key of the same form, a negative control."""


@dataclass(frozen=True)
class Scheme:
    """A scheme: its name, three functions and their properties.

    ``embed(pair, seed, device, *, message_weight=..., ...) -> (PublicModel, Key)`` trains; the same arguments give the
    same bits. ``message_weight=0`` gives a clean model of the same form, and None. Its keyword-only parameters are the
    scheme's settings, numbers annotated with their bounds (`gspure.settings`).
    """

    name: str  # unique; a folder of results
    embed: Callable[..., tuple[PublicModel, Key | None]]
    read_public: Callable[[Path], PublicModel]  # of the model's .ply or its folder
    read_key: Callable[[Path], Key]  # of a folder, the inverse of `Key.write`
    extractions: Mapping[str, Sequence[str]]
    """For each extraction, the columns of the public file that it reads: names, or patterns such as ``f_rest_*``. The
    first extraction is ``message``; the names of all others begin with ``message``. Hidden bits are instead ``bits``,
    read from renders of the scene, or ``model_bits``, read from the rows."""

    tau_c: float = TAU_C  # cluster and noise pruning factors that suit the scheme
    tau_n: float = TAU_N
    signature: tuple[str, ...] = ()
    """Columns by which commands recognize the scheme's public files; empty if they look like vanilla 3DGS, for which
    commands need ``--scheme``."""

    beside: tuple[str, ...] = ()  # patterns of the names of public files beside the .ply, such as networks
    packages: Mapping[str, str] = field(default_factory=dict)  # optional imports, each with its requirement for pip
    reveals: bool = True  # whether keys return the Gaussians that show the message (`Key.gaussians`)
    sources: tuple[Path, ...] = ()  # files besides its modules on which its results depend
    carriers: tuple[str, ...] = ()
    """Columns of the public file, as in `extractions`, that carry the message; empty if unknown."""

    redraw: Callable[[PublicModel, np.random.Generator], PublicModel] | None = None
    """Draws the carriers again; by default, their values are exchanged among rows."""

    copy: Callable[[PublicModel, PublicModel], PublicModel] | None = None
    """Copies the mark of a model onto another one, without a key; by default, its carriers, row by nearest row."""

    fits: bool = False  # whether ``message_adaptive`` learns from photographs of the message (`Key.fitted`)

    @property
    def settings(self) -> dict[str, Setting]:
        """The settings of `embed` and their defaults."""
        return defaults(self.embed)

    def redrawn(self, public: PublicModel, rng: np.random.Generator) -> PublicModel | None:
        """Return the model with its `carriers` drawn again: all of it but the message; None if these are unknown."""
        if self.redraw:
            return self.redraw(public, rng)
        return permuted(public, self.carriers, rng) if self.carriers else None

    def copied(self, marked: PublicModel, onto: PublicModel) -> PublicModel | None:
        """Return another model with the mark of a marked one, as far as it is known without a key; None if it is not.

        Networks beside the rows are those of the marked model.
        """
        if self.copy:
            return self.copy(marked, onto)
        return transplanted(marked, onto, self.carriers) if self.carriers else None

    @property
    def modules(self) -> tuple[str, ...]:
        """The modules that define its functions."""
        functions = (self.embed, self.read_public, self.read_key)
        whole = (known.func if isinstance(known, partial) else known for known in functions)
        return tuple(dict.fromkeys(known.__module__ for known in whole))


@dataclass(frozen=True, eq=False)
class Run:
    """The arguments that the training loops of all schemes share."""

    pair: Pair
    iterations: int
    message_weight: float  # lambda in L = L_scene + lambda L_message, 0 for a clean model
    most_rows: int
    seed: int
    device: Device
    hardened: float = 0.0  # unless 0, the message is kept off the rows that ``plain_weight`` removes with this tau
    schedule: str = SCHEDULES[0]


def hide(
    scheme: Scheme, pair: Pair, *, seed: int = 0, device: Device | None = None, **settings: Setting
) -> tuple[PublicModel, Key | None]:
    """Embed the pair's message in its scene, or raise `InputError` if a setting is unknown or out of range."""
    require_settings(f"scheme {scheme.name}", scheme.embed, settings)
    SEED.require(f"scheme {scheme.name}", "seed", seed)
    return scheme.embed(pair, seed, device, **settings)
