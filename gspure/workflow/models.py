"""The models of a configuration, and the files and options of their jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from gspure.cameras import GENERATED
from gspure.constants import TAU_C, TAU_N, TEST_EVERY
from gspure.evaluation.controls import CLEAN, CONTROLS, OTHER_SCENE, WRONG_KEY
from gspure.evaluation.detection import DETECTIONS
from gspure.evaluation.outcomes import BITS, MESSAGE, SCENE, Condition, is_picture
from gspure.scenes.procedural import DECOYS
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Scheme
from gspure.workflow.captures import camera_files
from gspure.workflow.decisions import Decisions, Settings, decisions, factors_of, is_swept, sweeps
from gspure.workflow.options import options, repeated
from gspure.workflow.pairs import is_photographed, other_pairs, pair_of, repetition_of, trained_message
from gspure.workflow.sources import code_digest

OWNER: Final = "message_"  # prefix of files that only the owner has: the views of the message
VANILLA: Final = "vanilla"  # folder of the user's own models


@dataclass(frozen=True)
class Plan:
    """All models of a resolved configuration."""

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
        """By scheme, all settings of every decision. They differ between schemes in the pruning factors only."""
        suited = {name: {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n} for name, scheme in self.schemes.items()}
        suited[VANILLA] = {"tau_c": TAU_C, "tau_n": TAU_N}
        return {name: decisions(self.config, factors) for name, factors in suited.items()}

    @cached_property
    def messages(self) -> dict[str, Settings]:
        """For each message to be trained from photographs, a pair that hides it."""
        return {trained_message(pair): pair for pair in self.config["pairs"].values() if "message_photographs" in pair}

    @property
    def sweep_options(self) -> str:
        """Variants that are one attack at several strengths, as options."""
        swept = sweeps(self.config["variants"], self.decisions[VANILLA])
        return repeated("--sweep", {name: ",".join(variants) for name, variants in swept.items()})

    @property
    def condition_options(self) -> str:
        """Protocol and initialization of every watermarked model as options."""
        models = [model for model in self.models if model.is_watermarked]
        conditions = {f"{m.scheme}/{m.scene}": f"{m.condition.protocol},{m.condition.initialization}" for m in models}
        return repeated("--condition", conditions)

    def condition_figures(self, scheme: str) -> dict[str, str]:
        """Return the options of each figure over all scenes of a condition; the user's own models have none."""
        if scheme == VANILLA:
            return {}
        variants, decisions = self.config["variants"], self.decisions[scheme]
        points = {name: f"{n},{c}" for name, (n, c) in factors_of(variants, decisions).items()}
        sweep = repeated("--point", points)
        figures = {"sweep": sweep} if is_swept(variants, decisions) else {}
        return figures | ({"tradeoff": ""} if MESSAGE in self.schemes[scheme].extractions else {})  # of two pictures


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
    def condition(self) -> Condition:
        """Its scheme, and protocol and initialization of its pair."""
        return Condition(self.scheme, self.settings.get("protocol", ""), self.settings.get("initialization", ""))

    @property
    def is_watermarked(self) -> bool:
        """Whether a scheme made it."""
        return self.scheme in self.plan.schemes

    @property
    def hides_bits(self) -> bool:
        """Whether its scheme hides bits, which are read from renders of the scene, not a picture."""
        return self.is_watermarked and BITS in self.plan.schemes[self.scheme].extractions

    @property
    def public(self) -> str:
        """The public model: the user's file in place, or the one trained here."""
        return str(self.settings.get("model", f"{self.folder}/public/point_cloud.ply"))

    @property
    def scheme_option(self) -> str:
        """The scheme as an option; commands recognize other models by their columns."""
        return f"--scheme {self.scheme}" if self.is_watermarked else ""

    @property
    def pair(self) -> dict[str, str]:
        """The files and folders of its pair."""
        names = {"cameras": "cameras.json", "points": "points3D.ply", "scene": "scene", "message": "message"}
        return {name: f"results/pairs/{pair_of(self.scene)}/{file}" for name, file in names.items()}

    @property
    def other_pair(self) -> str | None:
        """The first pair with another message, if there is one."""
        return next(iter(other_pairs(self.plan.config["pairs"], pair_of(self.scene))), None)

    def embedding_options(self, **changes: float) -> str:
        """Return the seed and the settings of its scheme as options, with `changes` of the settings."""
        settings = {**self.plan.config["schemes"][self.scheme], **changes}
        seed = settings.pop("seed") + repetition_of(self.scene)
        return f"--seed {seed} {options(self.settings, 'initialization')} {repeated('--set', settings)}"

    def code(self, command: str) -> str:
        """Return a digest of the code of its scheme and of a command."""
        return code_digest(f"gspure.cli.{command}", self.plan.schemes[self.scheme].module)

    def camera_source(self, target: str) -> str:
        """Return the source of the views of a target: a file or folder, or a way to generate them."""
        if self.is_watermarked:
            return self.pair["cameras"] if target == SCENE else self.pair["message"]
        return str(self.settings.get("cameras", f"{self.folder}/trained/cameras.json"))

    def camera_files(self, target: str) -> list[str]:
        """Return the files of the views of a target; none if they are generated."""
        source = self.camera_source(target)
        if self.is_watermarked:
            return [source]
        return [] if source in GENERATED else camera_files(source)

    @property
    def camera_options(self) -> str:
        """How to resize or generate its views, as options."""
        if self.is_watermarked:
            return "--resolution native"
        if self.camera_source(SCENE) in GENERATED:
            generated = {"model": self.public, **self.settings["generated"]}
            return options(generated, *generated)
        return options(self.settings, "resolution")

    def views(self, target: str) -> dict[str, str]:
        """Return the files of the views that show a target; those of the message are the owner's alone.

        Views off the path are left out for photographed pairs, which have no photographs there.
        """
        owner = "" if target == SCENE else OWNER
        files = {"cameras": f"{self.folder}/{owner}cameras.json"}
        if self.plan.config["views"]["off_path"] and not (self.is_watermarked and is_photographed(self.settings)):
            files["off_path"] = f"{self.folder}/{owner}off_path.json"
        return files

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
        return [control for control in controls if control != OTHER_SCENE or self.other_pair]

    @property
    def metrics(self) -> list[str]:
        """The metrics of all variants and controls; of bits, only those whose scene is of interest."""
        controls = [CLEAN] if self.hides_bits else self.controls
        return [f"{self.folder}/{name}/metrics.csv" for name in (*self.plan.config["variants"], *controls)]

    @property
    def detections(self) -> list[str]:
        """The readings of all detectors on all variants and the clean model; none of an asset that is a clean model.

        Hidden bits are also read from all controls.
        """
        if self.scene in {asset.get("clean") for asset in self.plan.scenes[self.scheme].values()}:
            return []
        variants = self.plan.config["variants"]
        names = [(n, d) for n in (*variants, *({CLEAN} & {*self.controls})) for d in self.plan.config["detectors"]]
        names += [(name, BITS) for name in (*variants, *self.controls) if self.hides_bits]
        return [f"{self.folder}/{name}/{DETECTIONS}/{detector}.csv" for name, detector in names]

    @property
    def references(self) -> list[str]:
        """The folders of images that variants are compared with."""
        if self.is_watermarked:
            return [self.pair[target] for target in ("scene", "message")]
        return [f"{self.folder}/unattacked/renders/scene"]

    @property
    def decoys(self) -> list[str]:
        """The folders of false candidates of its message: other messages, and random scenes of the same image size."""
        settings, others = self.settings, other_pairs(self.plan.config["pairs"], pair_of(self.scene))
        decoys = [f"results/pairs/{name}/message" for name in others]
        if is_photographed(settings):
            return decoys
        views = max(3, -(-settings["views"] // TEST_EVERY))  # as many as are held out; a pair has at least three
        folder = f"results/decoys/{settings['width']}x{settings['height']}x{views}"
        return decoys + [f"{folder}/{seed}" for seed in DECOYS]

    @property
    def hidden(self) -> list[str]:
        """The message's weight of each row, if the message is a picture."""
        return [f"{self.folder}/hidden.npy"] if self.is_watermarked and not self.hides_bits else []

    @property
    def columns(self) -> dict[str, str]:
        """Folders of images by title, with a folder per target: photographs, the unattacked model, all others."""
        photographs = {"truth": f"results/pairs/{pair_of(self.scene)}"} if self.is_watermarked else {}
        names = sorted(self.plan.config["variants"], key=lambda name: name != "unattacked")
        return photographs | {name: f"{self.folder}/{name}/renders" for name in names}

    def panel_columns(self, target: str) -> dict[str, str]:
        """Return the folders of images of a target by title: photographs, before GSPure, and after it."""
        photographed = {"truth": target.partition("_")[0]}
        titles = [title for title in ("truth", "unattacked", "gspure") if title in self.columns]
        return {title: f"{self.columns[title]}/{photographed.get(title, target)}" for title in titles}

    @property
    def variant_figures(self) -> dict[str, str]:
        """The options of each figure of all its variants."""
        return {"outcomes": "", "attacks": f"{repeated('--column', self.columns)} {self.plan.sweep_options}"}

    @property
    def figures(self) -> list[str]:
        """Its figures in the order of the page; those below ``model`` are of one folder."""
        clouds = ["purification", "kept", "clusters"] if self.hidden else ["kept", "clusters", "ranks"]
        of_model = [f"model/{name}" for name in ("splats", "weights", *clouds)]
        names = [*self.variant_figures, *of_model[:2], *self.targets, *of_model[2:]]
        return [f"{self.folder}/figures/{name}.png" for name in names]
