"""The plan of a run: its models, with their files and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from gspure.cameras import GENERATED
from gspure.constants import TAU_C, TAU_N, TEST_EVERY
from gspure.evaluation.names import CLEAN, CONTROLS, OTHER_SCENE, UNATTACKED, WRONG_KEY
from gspure.evaluation.outcomes import BITS, SCENE, is_picture
from gspure.method.features import PARTS
from gspure.scenes.procedural import DECOYS
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Scheme
from gspure.workflow.decisions import FACTORS, METHOD, Decisions, Settings, first_alike
from gspure.workflow.inputs import camera_files, is_photographed, message_name, message_of, model_files, pair_of

VANILLA: Final = "vanilla"  # folder of the user's own models


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
        pairs, message = self.plan.config["pairs"], message_of(self.settings)
        return [name for name, pair in pairs.items() if message_of(pair) != message]

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
