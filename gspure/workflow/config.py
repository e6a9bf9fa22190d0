"""The configuration of the workflow: all its settings, with their bounds, defaults and descriptions."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal

from gspure.codec import REST, Text
from gspure.evaluation.plan import Until
from gspure.method.settings import MethodSettings
from gspure.metrics.names import GSPURE, UNATTACKED
from gspure.settings import (
    COORDINATE,
    CORES,
    DECIBELS,
    FIELD_OF_VIEW,
    MAX_GAUSSIANS,
    PAIR_VIEWS,
    SECONDS,
    SIDE,
    STEPS,
    TRACED_SIDE,
    VIEWS,
    Range,
    Setting,
)

SEEDS: Final = Range(0, 4_000_000_000)  # repetitions add to a seed
REPETITIONS: Final = Range(1, 100)
GENERATED_VIEWS: Final = Range(2, 10_000)
CANDIDATES: Final = Range(0, 100_000)
CLEAN_MODELS: Final = Range(1, 100)
TWINS: Final = Range(0, 1000)

NAME: Final = Text(
    r"(?!-)(?!.*?(.+?)\1{19}$)[A-Za-z0-9_-]{1,100}",
    "a name of at most 100 letters, digits, _ and -, which does not begin with - or repeat itself 20 times",
)
RESOLUTION: Final = Text(
    r"native|photographs|1/[1-9][0-9]{0,4}|[1-9][0-9]{0,4}px", "native, photographs, 1/N or Wpx (such as 1600px)"
)
BITS_TEXT: Final = Text(r"[01]{0,4096}", 'bits in quotes, such as "0110"')
PATH: Final = Text(r"[\s\S]{1,4096}", "a path")
LINE: Final = Text(r"[\s\S]{0,1000}", "a text of at most 1000 characters")

Name = Annotated[str, NAME]
File = Annotated[str, PATH]
Seed = Annotated[int, SEEDS]
Resolution = Annotated[str, RESOLUTION]


@dataclass(frozen=True)
class TrainingConfig:
    """Training of a model from photographs."""

    iterations: Annotated[int, STEPS, "Number of training steps."] = 3000
    resolution: Annotated[Resolution, "Size of the training images, in the format of `resolution` of `assets`."] = (
        "320px"
    )
    seed: Annotated[Seed, "Random seed."] = 0
    max_gaussians: Annotated[
        Annotated[int, MAX_GAUSSIANS] | None,
        "Maximum number of Gaussians; null: one per point plus one per pixel of a view.",
    ] = None


@dataclass(frozen=True)
class GeneratedViews:
    """Views generated around a model."""

    count: Annotated[int, GENERATED_VIEWS, "Number of views."] = 24
    width: Annotated[int, SIDE, "Width in pixels."] = 640
    height: Annotated[int, SIDE, "Height in pixels."] = 480
    fov: Annotated[float, FIELD_OF_VIEW, "Horizontal field of view in degrees."] = 50.0
    up: Annotated[
        tuple[Annotated[float, COORDINATE], Annotated[float, COORDINATE], Annotated[float, COORDINATE]] | None,
        "Up direction of the model's world: 0 -1 0 for models from COLMAP, often 0 0 1 for others. null: guessed from "
        "the model's shape.",
    ] = None


@dataclass(frozen=True)
class AssetConfig:
    """A model of the user's, or photographs to train one from."""

    model: Annotated[
        File | None, "File of a 3DGS model, or output folder of a training run (its newest iteration is used)."
    ] = None
    cameras: Annotated[
        File | None,
        "Camera file or folder (cameras.json of 3DGS, COLMAP sparse model, transforms.json); or `orbit` or `shells` to "
        "generate views around the model.",
    ] = None
    key: Annotated[
        File | None, "Folder of the owner's key from `gspure embed`: the message is extracted after every attack."
    ] = None
    scheme: Annotated[
        Name | None, "Scheme of the key; by default the one that `gspure embed` wrote down in its folder."
    ] = None
    message: Annotated[
        File | None,
        "Photographs of the message with their cameras, as for `train`, to compare extractions with; by default they "
        "are compared with that of the unattacked model, in the views of `cameras`.",
    ] = None
    clean: Annotated[
        Name | None,
        "Name of another asset that has no `clean` itself: the negative control, a model of the same scene without the "
        "mark that `detectors` read.",
    ] = None
    train: Annotated[
        File | None,
        "Photographs to train a model from, instead of `model` and `cameras`: a COLMAP project, transforms.json, or "
        "cameras.json that names photographs, or a folder with one of them.",
    ] = None
    training: Annotated[TrainingConfig, "Settings of training."] = TrainingConfig()
    resolution: Annotated[
        Resolution,
        "Image size of the views of a camera file: `native`, `1/N`, `Wpx` (at most W pixels wide; 3DGS trains at "
        "1600px), or `photographs` (the size of the photographs, which may be downscaled copies).",
    ] = "1600px"
    generated: Annotated[GeneratedViews, "Settings of generated views."] = GeneratedViews()


@dataclass(frozen=True)
class PairConfig:
    """A scene, and a message to hide in it."""

    scene: Annotated[
        File,
        "The visible scene: `room`, `vault`, `interior-SEED`, `landscape-SEED` or `object-SEED`, which are "
        "ray-traced; or photographs, as for `train`.",
    ] = "room"
    message: Annotated[
        File,
        "The hidden scene: one of the same names; or, if the scene is photographs, a trained model (.ply or its "
        "folder) or photographs to train one from.",
    ] = "vault"
    protocol: Annotated[
        Literal["shared", "own"],
        "Poses of the message's views: `shared` with the scene, or its `own`. With photographs and `own`, the message "
        "is photographs too.",
    ] = "shared"
    initialization: Annotated[
        Literal["both", "scene"],
        "Points that training starts from: those of scene and message (`both`), or of the `scene`.",
    ] = "both"
    placement: Annotated[
        Literal["coincident", "raised", "front", "behind"],
        "Ray-traced: position of the message's surfaces relative to those of the scene.",
    ] = "raised"
    views: Annotated[int, PAIR_VIEWS, "Ray-traced: number of views, test views included."] = 32
    width: Annotated[int, TRACED_SIDE, "Ray-traced: width of the views in pixels."] = 160
    height: Annotated[int, TRACED_SIDE, "Ray-traced: height of the views in pixels."] = 120
    resolution: Annotated[Resolution, "Photographs: image size, in the format of `resolution` of `assets`."] = "320px"
    iterations: Annotated[
        int, STEPS, "Photographs: training steps of the message's model, if it has to be trained."
    ] = 3000
    seed: Annotated[Seed, "Random seed."] = 0


@dataclass(frozen=True)
class SchemeConfig:
    """A watermarking scheme: the random seed and the settings of its training."""

    settings: Annotated[Mapping[str, Setting], REST] = field(default_factory=dict)
    seed: Annotated[Seed, "Random seed of the training."] = 0
    clean_models: Annotated[
        Annotated[int, CLEAN_MODELS],
        "Clean models of each pair, as controls. Keys that learn (KeySS, the adaptive ones of GS-Hider and SecureGS) "
        "prove nothing without eight.",
    ] = 1


@dataclass(frozen=True)
class DetectorConfig:
    """A command that reads a mark from renders, or from the model's file."""

    command: Annotated[
        File | None,
        "A command; the folder of images, or the model's file, is appended. The last line that it prints is a JSON "
        'object with an entry for each image, by its name without .png, or for "model": bits ("0110"), or a score. '
        "By default that of the plug-in's detector of this name.",
    ] = None
    message: Annotated[
        str, BITS_TEXT, "The embedded bits, such as 0110, in quotes; empty if the command returns scores."
    ] = ""
    timeout: Annotated[float, SECONDS, "Seconds to wait for an answer."] = 600.0
    reads: Annotated[
        Literal["renders", "model"], "What the command gets: renders of the scene, or the file of the public model."
    ] = "renders"


@dataclass(frozen=True)
class ViewsConfig:
    """Use of the views."""

    evaluate: Annotated[
        Literal["test", "train", "all"],
        "Views to compare variants on. Sorted by name, every eighth view from the first on is a test view; "
        "contributions are measured on the others.",
    ] = "test"
    parts: Annotated[int, VIEWS, "Number of jobs that share the views of one model. Results do not depend on it."] = 1


@dataclass(frozen=True)
class ProofConfig:
    """What a message that is a picture is compared with."""

    candidates: Annotated[
        int,
        CANDIDATES,
        "Number of other pictures of the kind of a ray-traced message. With N of them, a message is proven at "
        "p = 1 / (N + 1), and at 0.001 with 999 or more.",
    ] = 199
    twins: Annotated[int, TWINS, "Number of models whose carriers of the message are drawn again."] = 8


Damage = Annotated[float, DECIBELS]


@dataclass(frozen=True)
class VariantConfig:
    """An attack and its settings."""

    settings: Annotated[Mapping[str, Setting], REST] = field(default_factory=dict)
    attack: Annotated[Name | None, "Name of the attack."] = None
    decision: Annotated[
        Name | None,
        "Name of the decision whose weights and prune mask the attack uses; by default that of `method`. If the "
        "attack has a setting `tau`, its default is the decision's tau_n.",
    ] = None
    seed: Annotated[Seed, "Random seed of the attack."] = 0
    damage: Annotated[
        Damage | tuple[Damage, ...] | None,
        "Drop of the scene's PSNR in dB, or a list of them, instead of the attack's strength: the strength is "
        "searched. Each is a variant of its own, NAME@1dB; together they are a sweep.",
    ] = None
    until: Annotated[
        Until | None,
        "Instead of the attack's strength: the least one is searched after which the owner's message is gone, or "
        "unreadable.",
    ] = None


DEFAULT_VARIANTS: Final = (
    UNATTACKED,
    GSPURE,
    "random_pruning",
    "feature_scaling",
    "gaussian_noise",
    "gof",
    "plain_weight",
    "random_matched",
)


def default_variants() -> dict[str, VariantConfig]:
    """Return the attacks of a run that names none."""
    return {name: VariantConfig() for name in DEFAULT_VARIANTS}


@dataclass(frozen=True)
class Config:
    """Settings of one run of the workflow. All have defaults except the models to evaluate."""

    assets: Annotated[
        Mapping[Name, AssetConfig],
        "Your own models, by scene name. The name becomes a folder of results/vanilla or, with a key, of "
        "results/SCHEME.",
    ] = field(default_factory=dict)
    pairs: Annotated[
        Mapping[Name, PairConfig],
        "Pairs of a scene and a message to hide in it, by name. Every scheme of `schemes` is trained on every pair. "
        "The name becomes a folder of results/SCHEME.",
    ] = field(default_factory=dict)
    schemes: Annotated[
        Mapping[Name, SchemeConfig],
        "Watermarking schemes to evaluate, by name (splats_in_splats, gs_hider, secure_gs, each also with _hardened; "
        "keyss; the last three also with _canonical; keyed_pattern; or that of an installed plug-in), each with a "
        "random seed and its training settings.",
    ] = field(default_factory=dict)
    detectors: Annotated[
        Mapping[Name, DetectorConfig],
        "Commands that read a mark from the renders of the scene, by name. Each is run on every variant of every "
        "model, and on the clean models.",
    ] = field(default_factory=dict)
    extractions: Annotated[
        tuple[Name, ...] | None,
        "Extractions of the message to evaluate, of those that the scheme has; null means all. `message_adaptive` of "
        "gs_hider and secure_gs trains networks for every variant.",
    ] = None
    repetitions: Annotated[
        int,
        REPETITIONS,
        "Number of times that every scheme is trained on every pair and attacked. Repetition N adds N, from 0 on, to "
        "the seeds of `schemes` and `variants`; its results are in PAIR@N, those of repetition 0 in PAIR.",
    ] = 1
    views: Annotated[ViewsConfig, "Use of the views."] = ViewsConfig()
    proof: Annotated[ProofConfig, "What a message is compared with."] = ProofConfig()
    method: Annotated[MethodSettings, "Settings of GSPure."] = field(default_factory=MethodSettings)
    decisions: Annotated[
        Mapping[Name, MethodSettings],
        "Further decisions, by name, for ablations and sweeps. Each inherits from `method` the settings it does not "
        "set itself. Results that decisions share are computed once.",
    ] = field(default_factory=dict)
    variants: Annotated[
        Mapping[Name, VariantConfig],
        "Variants of each model to evaluate, by name: the attack (default: the variant's name), a random seed, and "
        "the attack's settings. A variant with the name of an attack must be that attack. `unattacked` (the model "
        "itself) and `gspure` are required.",
    ] = field(default_factory=default_variants)
    suite: Annotated[
        Name | None,
        "A named list that never changes (small-1, standard-1, everyday-1), in place of `variants`.",
    ] = None
    device: Annotated[
        str, LINE, "OpenCL device: part of its name, or its index in `gspure doctor`. Empty: the first working device."
    ] = ""
    threads: Annotated[
        Annotated[int, CORES] | None,
        "Threads per job on an OpenCL CPU. null: all cores, one such job at a time; for ray-traced pairs of small "
        "images, one thread, and as many jobs at a time as there are cores. Results do not depend on it.",
    ] = None
