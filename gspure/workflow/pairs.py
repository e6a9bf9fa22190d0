"""Pairs of a configuration: ray-traced, or made from photographs and a model of the message."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from gspure.datasets import SCENES
from gspure.errors import InputError, reading
from gspure.evaluation.identity import RESULTS
from gspure.evaluation.plan import Candidates, Preparation, Split
from gspure.files import digest, read_json
from gspure.model import is_trained_model
from gspure.provenance import PROVENANCE
from gspure.scenes.candidates import kind_of
from gspure.scenes.procedural import NAMES, scene_builder
from gspure.workflow.config import PairConfig
from gspure.workflow.inputs import camera_files, capture_files, model_files

SMALL_IMAGE: Final = 256 * 256  # pixels: so few tiles give a second thread little to do; ours


@dataclass(frozen=True)
class PlannedPair:
    """A pair with its name, ray-traced or made of photographs."""

    name: str
    config: PairConfig
    is_traced: bool

    @property
    def folder(self) -> Path:
        """The folder of its photographs and cameras."""
        return RESULTS / "pairs" / self.name

    @property
    def files(self) -> tuple[Path, ...]:
        """What the training of a scheme reads of it."""
        return tuple(self.folder / name for name in ("cameras.json", "points3D.ply", "scene", "message"))

    @property
    def has_small_images(self) -> bool:
        """Whether its images are too small for more than one thread."""
        return self.is_traced and self.config.width * self.config.height <= SMALL_IMAGE

    @property
    def message_identity(self) -> str:
        """What tells its message from that of another pair."""
        return self.config.message if self.is_traced else os.path.realpath(self.config.message)

    @property
    def trains_message(self) -> bool:
        """Whether a model of its message is trained from photographs first."""
        return not self.is_traced and self.config.protocol == "shared" and not is_trained_model(self.config.message)

    @property
    def message_name(self) -> str:
        """The name of the message's trained model: that of its folder, and a digest of its training settings."""
        config = self.config
        settings = (config.message, str(config.iterations), config.resolution, str(config.seed))
        return f"{Path(config.message).stem}-{digest(*settings)[:8]}"

    @property
    def message_model(self) -> Path:
        """The folder of the message's trained model, which pairs with the same message share."""
        return RESULTS / "messages" / self.message_name

    def candidates(self, count: int, split: Split) -> Candidates | None:
        """Return what the pictures of the message's kind are traced with; None if there is no such kind."""
        config = self.config
        kind = kind_of(config.message, config.placement) if self.is_traced else None
        if not kind or not count:
            return None
        return Candidates(*kind, config.views, config.width, config.height, split, count)


def planned_pair(name: str, config: PairConfig, source: str) -> PlannedPair:
    """Return a pair; raise `InputError` unless both scenes are ray-traced, or both are files that exist."""
    place = f"pairs.{name}"
    is_traced = [scene_builder(scene) is not None for scene in (config.scene, config.message)]
    if is_traced[0] != is_traced[1]:
        expected = f"both of {NAMES}, or both paths"
        raise InputError(source, place, expected=expected, found=f"{config.scene} and {config.message}")
    if not is_traced[0]:
        require_path(config.scene, source, f"{place}.scene")
        require_path(config.message, source, f"{place}.message")
    return PlannedPair(name, config, is_traced[0])


def candidates_of_message(message: Path, count: int, split: Split) -> Candidates | None:
    """Return what the pictures of a message's kind are traced with, by what `gspure pair` wrote down; None if unknown.

    `message` is the folder of a pair's message.
    """
    file = message.parent / PROVENANCE
    if not file.is_file() or not count:
        return None
    with reading(file, "the provenance of a pair"):
        record = read_json(file)
        settings = record["settings"] if record["command"] == "pair" else {}
        kind = kind_of(str(settings.get("message", "")), str(settings.get("placement", "")))
        if kind is None:
            return None
        return Candidates(*kind, settings["views"], settings["width"], settings["height"], split, count)


def require_path(path: str, source: str, place: str) -> None:
    """Raise `InputError` unless a file or a folder exists."""
    if not Path(path).is_file() and not Path(path).is_dir():
        name = Path(path).name
        hint = f"gspure download {name}" if name in SCENES else None
        raise InputError(source, place, expected="an existing file or folder", found=path, hint=hint)


def pair_training(pair: PlannedPair) -> Preparation:
    """Return how a pair is made."""
    config = pair.config
    message = str(pair.message_model) if pair.trains_message else config.message
    names = ["protocol", "placement", "views", "width", "height", "seed"]
    if not pair.is_traced:
        names = ["protocol", "resolution", "seed"]
    return Preparation(
        sources=(config.scene, message),
        options={name: getattr(config, name) for name in names},
        users_files=_pair_files(pair),
        inputs=(pair.message_model,) if pair.trains_message else (),
        has_small_images=pair.has_small_images,
    )


def _pair_files(pair: PlannedPair) -> tuple[Path, ...]:
    """Return the user's files that a pair is made from; none if it is ray-traced."""
    if pair.is_traced:
        return ()
    scene = capture_files(pair.config.scene)
    message = pair.config.message
    if pair.config.protocol == "own":
        return (*scene, *capture_files(message))
    if pair.trains_message:
        return scene
    return (*scene, *model_files(message), *camera_files(message))


def message_training(pair: PlannedPair) -> tuple[str, Preparation] | None:
    """Return the name of a pair's message and how its model is trained; None if it is not."""
    if not pair.trains_message:
        return None
    options = {name: getattr(pair.config, name) for name in ("iterations", "resolution", "seed")}
    return pair.message_name, Preparation((pair.config.message,), options, capture_files(pair.config.message))
