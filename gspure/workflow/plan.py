"""The plan of a run: its models and their variants, with the files and settings of every job."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Any, Final

from gspure.attacks import find_attack
from gspure.attacks.attack import Attack
from gspure.attacks.registry import BUILT_IN
from gspure.cameras import GENERATED
from gspure.cameras.reading import CAMERA_FILES
from gspure.constants import TAU_C, TAU_N, TEST_EVERY
from gspure.evaluation.collecting import ModelPlan
from gspure.evaluation.detection import files_of
from gspure.evaluation.names import BASELINES, CLEAN, CONTROLS, GSPURE, OTHER_SCENE, UNATTACKED, WRONG_KEY
from gspure.evaluation.outcomes import BITS, SCENE, is_picture
from gspure.files import digest
from gspure.method.features import PARTS
from gspure.model import model_file
from gspure.model.inria import UNPACKED_SOG
from gspure.report.writing import ReportPlan
from gspure.scenes.procedural import DECOYS
from gspure.schemes.registry import find_scheme, schemes
from gspure.schemes.scheme import ADAPTIVE, Scheme
from gspure.training.dataset import BLENDER_HELD_OUT, POINT_FILES

Settings = Mapping[str, Any]
Decisions = Mapping[str, Settings]

VANILLA: Final = "vanilla"  # folder of the user's own models
METHOD: Final = "method"  # name of the decision with the settings of `method` in the configuration
FACTORS: Final = ("tau_c", "tau_n")

MADE: Final[Mapping[str, Sequence[str]]] = {
    "contributions": ("energy",),
    "weights.npy": ("reduction", "views"),
    "opacities.npy": (),
    "features.npy": (),
    "tree.npy": ("cluster_on", "min_samples"),
    "clusters.npz": ("min_cluster_size", "selection", "max_cluster_share"),
    "prune_mask.npy": FACTORS,
}
"""What is made for a decision, in this order, and the settings that each depends on besides those before it."""


@dataclass(frozen=True)
class Plan:
    """All models of a resolved configuration (`gspure.workflow.configuration.resolve`)."""

    config: Settings

    @cached_property
    def schemes(self) -> dict[str, Scheme]:
        """The watermarking schemes by name."""
        return {name: find_scheme(name) for name in self.config["schemes"]}

    @cached_property
    def scenes(self) -> dict[str, Mapping[str, Settings]]:
        """By scheme, the settings of every scene: the user's models, or pairs; ``raised@1`` repeats pair ``raised``."""
        repetitions = range(self.config["repetitions"])
        pairs = {f"{name}@{n}" if n else name: pair for name, pair in self.config["pairs"].items() for n in repetitions}
        return {VANILLA: self.config["assets"], **dict.fromkeys(self.schemes, pairs)}

    @cached_property
    def models(self) -> list[Model]:
        """The models of all schemes."""
        return [Model(self, scheme, scene) for scheme, scenes in self.scenes.items() for scene in scenes]

    @cached_property
    def decisions(self) -> dict[str, Decisions]:
        """By scheme, all settings of every decision, that of the method first.

        They differ between schemes in the pruning factors only: those that are null suit the scheme.
        """
        suited = {name: {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n} for name, scheme in self.schemes.items()}
        suited[VANILLA] = {"tau_c": TAU_C, "tau_n": TAU_N}
        common = {"cluster_on": list(PARTS), **self.config["method"]}
        every = {METHOD: common} | {name: {**common, **own} for name, own in self.config["decisions"].items()}
        return {
            scheme: {name: {**own, **{tau: own[tau] or factors[tau] for tau in FACTORS}} for name, own in every.items()}
            for scheme, factors in suited.items()
        }

    @cached_property
    def messages(self) -> dict[str, Settings]:
        """For each message to be trained from photographs, a pair that hides it."""
        return {message_name(pair): pair for pair in self.config["pairs"].values() if "message_photographs" in pair}

    @property
    def report(self) -> ReportPlan:
        """What the report shows."""
        variants = self.config["variants"]
        factors = {scheme: factors_of(variants, self.decisions[scheme]) for scheme in self.schemes}
        return ReportPlan(
            {f"{model.scheme}/{model.scene}": model.reported for model in self.models},
            sweeps(variants, self.decisions[VANILLA]),
            {scheme: points for scheme, points in factors.items() if points},
            [Path("results/configuration.json"), Path("results/logs")],
        )


@dataclass(frozen=True)
class Model:
    """A scheme's model of a pair, or one of the user's own."""

    plan: Plan
    scheme: str
    scene: str

    @property
    def folder(self) -> str:
        """The folder of its results."""
        return f"results/{self.scheme}/{self.scene}"

    @property
    def settings(self) -> Settings:
        """Its entry in the configuration: of a pair, or of the user's own model."""
        return self.plan.scenes[self.scheme][self.scene]

    @property
    def is_watermarked(self) -> bool:
        """Whether a scheme made it."""
        return self.scheme in self.plan.schemes

    @property
    def hides_bits(self) -> bool:
        """Whether its scheme hides bits, which are read from renders of the scene, not a picture."""
        return self.is_watermarked and BITS in self.plan.schemes[self.scheme].extractions

    @property
    def hides_picture(self) -> bool:
        """Whether its scheme hides a picture."""
        return self.is_watermarked and not self.hides_bits

    @property
    def module(self) -> str:
        """The module of its scheme, whose edits make its results stale."""
        return self.plan.schemes[self.scheme].module if self.is_watermarked else "gspure.public_model"

    @property
    def named_scheme(self) -> str | None:
        """Its scheme; None for the user's own models, whose scheme is recognized by the columns."""
        return self.scheme if self.is_watermarked else None

    @property
    def public(self) -> str:
        """The public model: the user's file in place, or the one trained here."""
        return str(self.settings.get("model", f"{self.folder}/public/point_cloud.ply"))

    @property
    def users_files(self) -> list[str]:
        """The user's files that its jobs read as its public model."""
        return model_files(self.public) if "model" in self.settings else []

    @property
    def pair(self) -> str:
        """The folder of its pair."""
        return f"results/pairs/{pair_of(self.scene)}"

    @property
    def owned(self) -> dict[str, str]:
        """What only the owner has: the key, and the views of the message."""
        return {"key": f"{self.folder}/key", "message_cameras": f"{self.folder}/message_cameras.json"}

    @property
    def repetition(self) -> int:
        """The number of its repetition, which is added to all random seeds: 1, of ``raised@1``."""
        return int(self.scene.partition("@")[2] or 0)

    @property
    def other_pairs(self) -> list[str]:
        """The pairs with another message."""
        pairs = self.plan.config["pairs"]
        return [name for name, pair in pairs.items() if _message(pair) != _message(self.settings)]

    @property
    def embed_settings(self) -> dict[str, Any]:
        """The settings of its embedding."""
        settings = dict(self.plan.config["schemes"][self.scheme])
        seed = settings.pop("seed") + self.repetition
        return {"seed": seed, "initialization": self.settings["initialization"], "set": settings}

    @property
    def views(self) -> dict[str, str]:
        """The sources of its views: files, folders or a way to generate them; those of the message are the owner's."""
        if self.is_watermarked:
            return {"scene": f"{self.pair}/cameras.json", "message": f"{self.pair}/message"}
        return {"scene": str(self.settings.get("cameras", f"{self.folder}/trained/cameras.json"))}

    @property
    def view_settings(self) -> dict[str, Any]:
        """How its views are scaled or generated."""
        if self.is_watermarked:
            return {"resolution": "native"}
        if self.views["scene"] in GENERATED:
            return {"resolution": "native", "generated": self.settings["generated"]}
        return {"resolution": self.settings["resolution"]}

    @property
    def view_files(self) -> list[str]:
        """The files that its views are read from; none if they are generated."""
        if self.is_watermarked:
            return [*self.views.values()]
        return [] if self.views["scene"] in GENERATED else camera_files(self.views["scene"])

    @property
    def targets(self) -> list[str]:
        """What is compared: the scene, and the extractions of the message."""
        available = self.plan.schemes[self.scheme].extractions if self.is_watermarked else ()
        chosen = self.plan.config["extractions"] or available
        return [SCENE, *(name for name in available if name in chosen and is_picture(name))]

    @property
    def controls(self) -> list[str]:
        """Its negative controls; another scene's model must have another message."""
        controls = list(CONTROLS) if self.is_watermarked else [CLEAN] * bool(self.settings["clean"])
        if self.hides_bits:
            controls = [CLEAN, WRONG_KEY, OTHER_SCENE]
        return [control for control in controls if control != OTHER_SCENE or self.other_pairs]

    @property
    def variants(self) -> list[Variant]:
        """Its variants, without controls."""
        return [Variant(self, name) for name in self.plan.config["variants"]]

    @property
    def references(self) -> str:
        """The folder of images that variants are compared with, one folder per target."""
        return self.pair if self.is_watermarked else f"{self.folder}/{UNATTACKED}/renders"

    @property
    def decoys(self) -> list[str]:
        """The folders of false candidates of its message: other messages, and random scenes of the same image size."""
        if not self.hides_picture:
            return []
        decoys = [f"results/pairs/{name}/message" for name in self.other_pairs]
        if is_photographed(self.settings):
            return decoys
        views = max(3, -(-self.settings["views"] // TEST_EVERY))  # as many as are held out; a pair has at least three
        folder = f"results/decoys/{self.settings['width']}x{self.settings['height']}x{views}"
        return decoys + [f"{folder}/{seed}" for seed in DECOYS]

    @property
    def reported(self) -> ModelPlan:
        """What the report shows of it."""
        shown = [Variant(self, name) for name in (*self.plan.config["variants"], *self.controls)]
        return ModelPlan(
            [v.name for v in shown if v.is_attacked],
            [v.name for v in shown if not v.is_attacked and v.evaluation["compared"]],
            self.targets,
            {v.name: [*v.detectors] for v in shown if v.detectors},
            Path(self.pair) if self.is_watermarked else None,
            self.settings.get("protocol", ""),
            self.settings.get("initialization", ""),
        )

    def decision(self, name: str) -> Settings:
        """Return all settings of a decision."""
        return self.plan.decisions[self.scheme][name]

    def path(self, name: str, decision: str = METHOD) -> str:
        """Return the path of what is made for a decision, that of the first one with the same settings up to it."""
        first = first_alike(self.plan.decisions[self.scheme], decision, name)
        return f"{self.folder}/{name}" if first == METHOD else f"{self.folder}/decisions/{first}/{name}"

    def thresholded(self, decision: str = METHOD) -> str:
        """Return the file that the pruning factors apply to: weights, or opacities if clusters ignore weights."""
        uses_weights = "weight" in self.decision(decision)["cluster_on"]
        return self.path("weights.npy" if uses_weights else "opacities.npy", decision)

    def evaluation(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the settings of the job that evaluates some of its variants or controls."""
        adapts = ADAPTIVE in self.targets
        fits = adapts and self.plan.schemes[self.scheme].fits
        return {
            "cameras": f"{self.folder}/cameras.json",
            **(self.owned if self.is_watermarked else {}),
            "scheme": self.named_scheme,
            "split": self.plan.config["views"]["evaluate"],
            "reference": "truth" if self.is_watermarked else "render",
            "references": self.references,
            "published": self.public if adapts else None,
            "photographs": f"{self.pair}/message" if fits else None,
            "decoys": self.decoys,
            "variants": {name: Variant(self, name).evaluation for name in names},
        }


@dataclass(frozen=True)
class Variant:
    """A variant or a control of a model."""

    model: Model
    name: str

    @property
    def is_attacked(self) -> bool:
        """Whether it is a variant, not a control."""
        return self.name in self.model.plan.config["variants"]

    @property
    def folder(self) -> str:
        """The folder of its results."""
        return f"{self.model.folder}/{self.name}"

    @property
    def settings(self) -> Settings:
        """Its entry in the configuration."""
        settings: Settings = self.model.plan.config["variants"][self.name]
        return settings

    @property
    def attack(self) -> Attack:
        """Its attack."""
        return find_attack(self.settings["attack"])

    @property
    def measured(self) -> dict[str, str]:
        """The files that its attack needs beside the model."""
        model, decision = self.model, self.settings.get("decision", METHOD)
        files = {"opacities": model.path("opacities.npy"), "surface": f"{model.folder}/surface.npy"}
        files |= {name: model.path(f"{name}.npy", decision) for name in ("weights", "prune_mask")}
        if "labels" in self.attack.needs:
            files |= {"labels": model.path("clusters.npz", decision), "weights": model.thresholded(decision)}
        return {need: files[need] for need in sorted(self.attack.needs)}

    @property
    def rendered(self) -> dict[str, str]:
        """The public views, if its attack renders them; to search its strength, also any photographs of the scene."""
        is_searched = "damage" in self.settings
        cameras = {"cameras": f"{self.model.folder}/cameras.json"}
        photographs = {"photographs": f"{self.model.pair}/scene"} if self.model.is_watermarked and is_searched else {}
        return {**cameras, **photographs} if is_searched or "cameras" in self.attack.parameters else {}

    @property
    def attacked_by(self) -> dict[str, Any]:
        """Name, seed, damage and settings of its attack; unset factors of a built-in one are its decision's.

        Of a strength that is searched for a damage, there is no value.
        """
        attack, own = self.attack, self.settings
        decision = self.model.decision(own.get("decision", METHOD))
        factors = {name: decision[name] for name in FACTORS} | {"tau": decision["tau_n"]}
        searched = attack.strength.setting if "damage" in own and attack.strength else ""
        values = {**(factors if attack in BUILT_IN else {}), **own}
        settings = {name: value for name, value in values.items() if name in {*attack.settings} - {searched}}
        known = {"name": attack.name, "seed": own["seed"] + self.model.repetition, "settings": settings}
        wanted = {"damage": own["damage"], "split": self.model.plan.config["views"]["evaluate"]} if searched else {}
        return known | wanted

    @property
    def public(self) -> str:
        """The model that it shows."""
        model = self.model
        if self.name == OTHER_SCENE:
            return f"results/{model.scheme}/{model.other_pairs[0]}/public/point_cloud.ply"
        if self.name == CLEAN and not model.is_watermarked:
            return Model(model.plan, VANILLA, model.settings["clean"]).public
        if self.name in (WRONG_KEY, *BASELINES):
            return model.public
        return f"{self.folder}/public/point_cloud.ply"

    @property
    def targets(self) -> list[str]:
        """What is rendered of it; of controls that show a watermarked model, only the message is of interest."""
        shows_mark = self.name in (WRONG_KEY, OTHER_SCENE) and self.model.hides_picture
        return [] if self.name in BASELINES else self.model.targets[1:] if shows_mark else self.model.targets

    @property
    def detectors(self) -> dict[str, Settings]:
        """The detectors that read its renders: those of the user, also of clean models, and ``bits`` of hidden bits.

        Nothing is read from an asset that is the clean model of another one.
        """
        model, of_user = self.model, self.model.plan.config["detectors"]
        if model.scene in {asset.get("clean") for asset in model.plan.scenes[model.scheme].values()}:
            return {}
        bits: dict[str, Settings] = {BITS: {}} if model.hides_bits else {}
        return {**(of_user if self.is_attacked or self.name == CLEAN else {}), **bits}

    @property
    def users_files(self) -> list[str]:
        """The user's files that its evaluation reads: those that detectors name, such as code, and a clean model."""
        files = [file for each in self.detectors.values() if each for file in files_of(each["command"])]
        is_users = self.name == CLEAN and not self.model.is_watermarked
        return files + (model_files(self.public) if is_users and Path(self.public).is_file() else [])

    @property
    def evaluation(self) -> dict[str, Any]:
        """The settings of its evaluation; a baseline is compared in the views of the unattacked model.

        Of the controls of hidden bits, only the scene of the clean model is compared.
        """
        unseen = self.name in (WRONG_KEY, OTHER_SCENE) and self.model.hides_bits
        return {
            "folder": self.folder,
            "model": self.public,
            "rendered": self.targets,
            "compared": [] if unseen else self.model.targets if self.name in BASELINES else self.targets,
            "attacked": self.is_attacked,
            "baseline": self.name if self.name in BASELINES else None,
            "wrong_key": self.name == WRONG_KEY,
            "detectors": self.detectors,
        }


def pair_of(scene: str) -> str:
    """Return the pair of a model's scene: ``raised``, of ``raised@1``."""
    return scene.partition("@")[0]


def is_photographed(pair: Settings) -> bool:
    """Return whether a pair is made from photographs, rather than ray-traced."""
    return "photographs" in pair


def message_name(pair: Settings) -> str:
    """Return the name of a message's trained model: that of its folder and a digest of its training settings."""
    settings = [str(pair[name]) for name in ("message", "iterations", "resolution", "seed")]
    return f"{Path(pair['message']).stem}-{digest(*settings)[:8]}"


def message_model(pair: Settings) -> str:
    """Return the model of a photographed pair's message: the user's, or the one trained for all pairs that hide it."""
    return f"results/messages/{message_name(pair)}" if "message_photographs" in pair else str(pair["message"])


def pair_settings(pair: Settings) -> dict[str, Any]:
    """Return the settings of an entry of ``pairs`` that apply to it."""
    names = ("protocol", "placement", "views", "width", "height", "seed")
    return {name: pair[name] for name in (("protocol", "resolution", "seed") if is_photographed(pair) else names)}


def pair_files(pair: Settings) -> list[str]:
    """Return the user's files that a pair is made from: photographs and the message's model; none if ray-traced."""
    if not is_photographed(pair):
        return []
    scene = capture_files(pair["scene"], pair["photographs"])
    if "own_photographs" in pair:
        return [*scene, *capture_files(pair["message"], pair["own_photographs"])]
    if "message_photographs" in pair:
        return scene
    return [*scene, *model_files(pair["message"]), *camera_files(pair["message"])]


def _message(pair: Settings) -> str:
    message = str(pair["message"])
    return os.path.realpath(message) if is_photographed(pair) else message


def camera_files(source: str) -> list[str]:
    """Return the files of the cameras of `source`, a folder or a file of cameras."""
    return _files(source, CAMERA_FILES)


def capture_files(source: str, photographs: Sequence[str]) -> list[str]:
    """Return the files of the cameras and points of `source`, a folder or a file of cameras, and its photographs."""
    folder = Path(source) if Path(source).is_dir() else Path(source).parent
    names = [*BLENDER_HELD_OUT, "points3D.bin", "points3D.txt", *POINT_FILES]
    return [*camera_files(source), *_files(str(folder), names), *photographs]


def model_files(source: str) -> list[str]:
    """Return the file of a model, a file or a training run's folder, and all that may be read with it.

    That is cfg_args and the networks of schemes, beside the file or, for a model in ``point_cloud/iteration_N``, in the
    run's folder; and the images beside the index of an unpacked SOG model.
    """
    model = model_file(Path(source))
    folders = [model.parent, *([model.parents[2]] if model.parent.match("point_cloud/iteration_*") else [])]
    networks = [pattern for scheme in schemes().values() for pattern in scheme.beside]
    patterns = ["cfg_args", *(["*.webp"] if model.name == UNPACKED_SOG else []), *networks]
    beside = {str(file) for folder in folders for pattern in patterns for file in folder.glob(pattern)}
    return [str(model), *sorted(beside)]


def _files(source: str, names: Sequence[str]) -> list[str]:
    """Return the files of these names in a folder or its COLMAP model; a file stands for itself."""
    if not Path(source).is_dir():
        return [source]
    paths = [Path(source, place, name) for place in ("", "sparse/0", "sparse") for name in names]
    return [str(path) for path in paths if path.exists()]


def first_alike(among: Decisions, name: str, made: str) -> str:
    """Return the first decision that agrees with decision `name` in all settings that something made depends on."""
    relevant = [setting for each in (*takewhile(lambda each: each != made, MADE), made) for setting in MADE[each]]
    return next(other for other in among if all(among[other][s] == among[name][s] for s in relevant))


def sweeps(variants: Decisions, among: Decisions) -> dict[str, list[str]]:
    """Return the variants of each sweep, that is, of one attack at several strengths, by its name.

    A strength is a number: a setting of the attack, or a pruning factor of its decision, `among` those of the scheme.
    Variants that differ in anything else are different sweeps. A single variant is no sweep.
    """
    by_kind: dict[tuple[str, ...], list[str]] = {}
    for variant, settings in variants.items():
        by_kind.setdefault(_kind(settings, among), []).append(variant)
    swept = {" ".join(kind): names for kind, names in by_kind.items() if len(names) > 1}
    return {f"{name} sweep" if name in variants and name not in names else name: names for name, names in swept.items()}


def factors_of(variants: Decisions, among: Decisions) -> dict[str, tuple[float, float]]:
    """Return tau_n and tau_c of every variant that differs from GSPure in these alone, those with its factors first.

    There are none if no variant differs from GSPure in one factor alone.
    """
    kind = _kind({"attack": GSPURE, "seed": 0}, among)
    alike = [name for name, v in variants.items() if v["attack"] == GSPURE and _kind(v, among) == kind]
    chosen = {name: among[variants[name].get("decision", METHOD)] for name in alike}
    points = {name: (decision["tau_n"], decision["tau_c"]) for name, decision in chosen.items()}
    own = among[METHOD]["tau_n"], among[METHOD]["tau_c"]
    is_swept = any((n == own[0]) != (c == own[1]) for n, c in points.values())
    return dict(sorted(points.items(), key=lambda point: point[1] != own)) if is_swept else {}


def _kind(settings: Settings, among: Decisions) -> tuple[str, ...]:
    """Return what the variants of one sweep share: the attack, and all settings but its strength."""
    attack = find_attack(settings["attack"])
    kind = attack.kind(settings)
    if attack.needs & {"weights", "prune_mask"}:
        made = "clusters.npz" if attack.needs & {"prune_mask", "labels"} else "weights.npy"
        first = first_alike(among, settings.get("decision", METHOD), made)
        kind += [] if first == METHOD else [first]
    return tuple(kind)
