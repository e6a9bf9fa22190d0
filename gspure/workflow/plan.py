"""The plan of a run: its models, with their files and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from gspure.cameras import GENERATED
from gspure.constants import TAU_C, TAU_N, TEST_EVERY
from gspure.grouping import grouped
from gspure.method.features import PARTS
from gspure.metrics.names import BASELINES, CLEAN, CLEAN_GSPURE, OTHER_SCENE, UNATTACKED, WRONG_KEY
from gspure.metrics.targets import BITS, MESSAGE, SCENE, is_picture
from gspure.scenes.procedural import DECOYS
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Scheme
from gspure.workflow.decisions import FACTORS, METHOD, Decisions, Settings, first_alike
from gspure.workflow.inputs import camera_files, is_photographed, message_name, message_of, model_files, pair_of

VANILLA: Final = "vanilla"  # folder of the user's own models without a key


@dataclass(frozen=True)
class Plan:
    """All models of a resolved configuration (`gspure.workflow.configuration.resolve`)."""

    config: Settings

    @cached_property
    def schemes(self) -> dict[str, Scheme]:
        """The watermarking schemes by name: those to train, and those of the keys of the user's models."""
        of_keys = (asset["scheme"] for asset in self.config["assets"].values() if "key" in asset)
        return {name: find_scheme(name) for name in dict.fromkeys([*self.config["schemes"], *of_keys])}

    @cached_property
    def scenes(self) -> dict[str, Mapping[str, Settings]]:
        """By scheme, the settings of every scene: pairs, and the user's models; ``raised@1`` repeats pair ``raised``.

        A user's model without a key has no scheme, but is in the folder `VANILLA`.
        """
        repetitions = range(self.config["repetitions"])
        pairs = {f"{name}@{n}" if n else name: pair for name, pair in self.config["pairs"].items() for n in repetitions}
        trained: dict[str, dict[str, Settings]] = {VANILLA: {}}
        trained |= {name: pairs if name in self.config["schemes"] else {} for name in self.schemes}
        of_scheme = grouped(self.config["assets"].items(), lambda item: item[1].get("scheme", VANILLA))
        return {name: {**dict(of_scheme.get(name, ())), **pairs} for name, pairs in trained.items()}

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
    def is_users(self) -> bool:
        """Whether it is one of the user's own models, not one of a pair."""
        return not self.is_watermarked or "key" in self.settings

    @property
    def hides_bits(self) -> bool:
        """Whether its scheme hides bits, which are read from renders of the scene, not a picture."""
        return self.is_watermarked and BITS in self.plan.schemes[self.scheme].extractions

    @property
    def hides_picture(self) -> bool:
        """Whether its scheme hides a picture."""
        return self.is_watermarked and not self.hides_bits

    @property
    def reveals_rows(self) -> bool:
        """Whether its key tells which Gaussians show the hidden picture."""
        return self.hides_picture and self.plan.schemes[self.scheme].reveals

    @property
    def module(self) -> str:
        """The module of its scheme, whose edits make its results stale."""
        return self.plan.schemes[self.scheme].module if self.is_watermarked else "gspure.public_model"

    @property
    def public(self) -> str:
        """The public model: the user's file in place, or the one trained here."""
        return str(self.settings.get("model", f"{self.folder}/public/point_cloud.ply"))

    @property
    def sources(self) -> list[str]:
        """The files beside that module that decide what its scheme does."""
        return [str(file) for file in self.plan.schemes[self.scheme].sources] if self.is_watermarked else []

    @property
    def users_files(self) -> list[str]:
        """The user's files that its jobs read: of its scheme, public model and key, and photographs of its message."""
        own = self.settings
        key = sorted(str(file) for file in Path(own["key"]).glob("*")) if "key" in own else []
        return [
            *(model_files(self.public) if "model" in own else []),
            *key,
            *own.get("message_photographs", ()),
            *self.sources,
        ]

    @property
    def pair(self) -> str:
        """The folder of its pair."""
        return f"results/pairs/{pair_of(self.scene)}"

    @property
    def owned(self) -> dict[str, str]:
        """What only the owner has: the key, and the views of the message."""
        key = self.settings.get("key", f"{self.folder}/key")
        return {"key": key, "message_cameras": f"{self.folder}/message_cameras.json"}

    @property
    def repetition(self) -> int:
        """The number of its repetition, which is added to all random seeds: 1, of ``raised@1``."""
        return int(self.scene.partition("@")[2] or 0)

    @property
    def other_pairs(self) -> list[str]:
        """The pairs with another message; none for a user's model."""
        if self.is_users:
            return []
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
        if not self.is_users:
            return {"scene": f"{self.pair}/cameras.json", "message": f"{self.pair}/message"}
        scene = str(self.settings.get("cameras", f"{self.folder}/trained/cameras.json"))
        return {"scene": scene} | ({"message": self.settings.get("message", scene)} if self.is_watermarked else {})

    @property
    def view_settings(self) -> dict[str, Any]:
        """How its views are scaled or generated; photographs of a message are compared at their own size."""
        if not self.is_users:
            return {"resolution": "native"}
        settings = self.settings
        generated = {"generated": settings["generated"]} if self.views["scene"] in GENERATED else {}
        message = {"message_resolution": "photographs"} if "message" in settings else {}
        return {"resolution": "native" if generated else settings["resolution"], **generated, **message}

    @property
    def view_files(self) -> list[str]:
        """The files that its views are read from; none if they are generated."""
        if not self.is_users:
            return [*self.views.values()]
        sources = [view for view in dict.fromkeys(self.views.values()) if view not in GENERATED]
        return [file for source in sources for file in camera_files(source)]

    @property
    def targets(self) -> list[str]:
        """What is compared: the scene, and the extractions of the message."""
        available = self.plan.schemes[self.scheme].extractions if self.is_watermarked else ()
        chosen = self.plan.config["extractions"] or available
        return [SCENE, *(name for name in available if name in chosen and is_picture(name))]

    @property
    def controls(self) -> list[str]:
        """Its negative controls: GSPure prunes the clean model, too, in runs that compare attacks at equal damage.

        Another scene's model must have another message.
        """
        has_clean = not self.is_users or bool(self.settings["clean"])
        marked = [WRONG_KEY, *([OTHER_SCENE] if self.other_pairs else []), *([] if self.hides_bits else BASELINES)]
        clean = [CLEAN, *([CLEAN_GSPURE] if any("damage" in v for v in self.plan.config["variants"].values()) else [])]
        return clean * has_clean + (marked if self.is_watermarked else [])

    @property
    def photographed(self) -> list[str]:
        """What is compared with photographs; all else is compared with renders of the unattacked model."""
        if not self.is_users:
            return [SCENE, MESSAGE]
        return [SCENE] * self.settings.get("photographed", False) + [MESSAGE] * ("message" in self.settings)

    @property
    def decoys(self) -> list[str]:
        """The folders of false candidates of its message: the scene, other messages, random scenes of the same size."""
        if not self.hides_picture:
            return []
        if self.is_users:
            return [f"{self.folder}/{UNATTACKED}/renders/{SCENE}"]
        decoys = [f"{self.pair}/scene", *(f"results/pairs/{name}/message" for name in self.other_pairs)]
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
