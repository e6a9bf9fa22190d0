"""What a watermarking scheme is: a way to hide a message in a scene, and its owner's way to see it again."""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.constants import TAU_C, TAU_N
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.public_model import BLACK, Background, PublicModel, RenderView, Rows
from gspure.schemes.pair import Pair

Setting = float | int | str
MESSAGE: Final = "message"
"""The extraction that every scheme has."""

REQUIRED: Final = frozenset({"iterations", "message_weight"})
"""Settings that every scheme has: the length of its training, and the message's share in its loss (0 hides nothing)."""

PYTORCH: Final = {"torch": "gspure[torch]"}
"""The package that schemes with networks import."""


class Key(ABC):
    """All that is private to the owner."""

    @abstractmethod
    def write(self, folder: Path) -> None:
        """Write the key's files."""

    @abstractmethod
    def message(
        self, public: PublicModel, extraction: str, device: Device | None = None, background: Background = BLACK
    ) -> RenderView:
        """Return what the owner sees of the message in a public or attacked model."""

    @abstractmethod
    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:
        """Return the Gaussians whose blending shows the message, and the row of `public` that owns each."""

    @abstractmethod
    def wrong(self, rng: np.random.Generator) -> Key:
        """Return a key of the same form that holds nothing of this one: what a stranger would try."""


@dataclass(frozen=True)
class Scheme:
    """A scheme: its name and its three functions.

    Parameters
    ----------
    name : str
        Unique; a folder of results.
    embed : callable
        ``embed(pair, seed, device, *, iterations=..., message_weight=..., ...) -> (PublicModel, Key)``: trains;
        the same bits for the same arguments. With ``message_weight=0`` nothing is hidden: a
        clean model of the same form, and no key (None).
    read_public : callable
        ``read_public(path) -> PublicModel``: a model's .ply, or its folder.
    read_key : callable
        ``read_key(folder) -> Key``: what `Key.write` wrote.
    extractions : mapping of str to sequence of str
        Ways to look for the message, each with the columns of the public file that it reads, its *carrier*: names or
        patterns such as ``f_rest_*``. The first is the scheme's own, ``message``; the names of others begin with it.
    tau_c, tau_n : float
        Cluster and noise pruning factors that suit the scheme.
    signature : tuple of str
        Columns by which a public file is recognized as this scheme's; empty where it looks like vanilla 3DGS, and
        commands need ``--scheme``.
    packages : mapping of str to str
        Optional packages that it imports, each with what pip is to install for it.

    """

    name: str
    embed: Callable[..., tuple[PublicModel, Key | None]]
    read_public: Callable[[Path], PublicModel]
    read_key: Callable[[Path], Key]
    extractions: Mapping[str, Sequence[str]]
    tau_c: float = TAU_C
    tau_n: float = TAU_N
    signature: tuple[str, ...] = ()
    packages: Mapping[str, str] = field(default_factory=dict)

    @property
    def settings(self) -> dict[str, Setting]:
        """The settings of `embed` and their defaults."""
        parameters = inspect.signature(self.embed).parameters.values()
        return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}

    def require_settings(self, settings: Mapping[str, Setting]) -> None:
        """Refuse settings that the scheme does not have."""
        for name in settings.keys() - self.settings.keys():
            known = ", ".join(self.settings)
            raise InputError(f"scheme {self.name}", "setting", expected=f"one of {known}", found=name)


def require(scheme: str, name: str, value: Setting, expected: str, *, fits: bool) -> None:
    """Refuse a setting of a scheme that does not fit."""
    if not fits:
        raise InputError(f"scheme {scheme}", name, expected=expected, found=str(value))


def hide(
    scheme: Scheme, pair: Pair, *, seed: int = 0, device: Device | None = None, **settings: Setting
) -> tuple[PublicModel, Key | None]:
    """Embed the pair's message in its scene.

    Raises
    ------
    InputError
        A setting is unknown or out of range.

    """
    scheme.require_settings(settings)
    chosen = scheme.settings | settings
    require(scheme.name, "iterations", chosen["iterations"], "at least 1", fits=float(chosen["iterations"]) >= 1)
    weight = float(chosen["message_weight"])
    require(scheme.name, "message_weight", chosen["message_weight"], "at least 0", fits=0 <= weight < math.inf)
    require(scheme.name, "seed", seed, "at least 0", fits=seed >= 0)
    return scheme.embed(pair, seed, device, **settings)
