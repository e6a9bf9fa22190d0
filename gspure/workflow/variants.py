"""The variants and controls of a model, and their decisions: the files and options of their jobs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from gspure.attacks import find_attack
from gspure.attacks.attack import Attack
from gspure.attacks.registry import BUILT_IN
from gspure.cost import COSTS, cost_of
from gspure.evaluation.controls import BASELINES, CLEAN, MESSAGE_FREE, OTHER_SCENE, WRONG_KEY
from gspure.evaluation.outcomes import BITS
from gspure.schemes.scheme import ADAPTIVE
from gspure.workflow.decisions import ARTIFACTS, DEFAULT, FACTORS, Settings, origin
from gspure.workflow.models import VANILLA, Model
from gspure.workflow.options import options, repeated
from gspure.workflow.pairs import repetition_of
from gspure.workflow.sources import code_digest

_CLUSTERED: Final = ("contributions", "weights.npy", "opacities.npy", "features.npy", "tree.npy", "clusters.npz")

MEASURED: Final[Mapping[str, Sequence[str]]] = {
    "weights": _CLUSTERED[:2],
    "opacities": ("opacities.npy",),
    "surface": ("surface.npy",),
    "labels": _CLUSTERED,
    "prune_mask": (*_CLUSTERED, "prune_mask.npy"),
}
"""All artifacts that a piece of evidence takes."""


@dataclass(frozen=True)
class Decision:
    """A decision about a model."""

    model: Model
    name: str = DEFAULT

    @property
    def settings(self) -> Settings:
        """All of its settings."""
        return self.model.plan.decisions[self.model.scheme][self.name]

    def options(self, *names: str) -> str:
        """Return some of its settings as options."""
        return options(self.settings, *names)

    def path(self, artifact: str) -> str:
        """Return the path of an artifact: that of the first decision that has the same."""
        first = origin(self.model.plan.decisions[self.model.scheme], self.name, artifact)
        folder = "" if first == DEFAULT else f"decisions/{first}/"
        return f"{self.model.folder}/{folder}{artifact}"

    def logs(self, artifact: str) -> list[str]:
        """Return the logs of the jobs that make an artifact."""
        path = self.path(artifact) if artifact in ARTIFACTS else f"{self.model.folder}/{artifact}"
        log = path.replace("results", "results/logs", 1)
        parts = self.model.plan.config["views"]["parts"]
        return [f"{log}/{n}-of-{parts}.log" for n in range(1, parts + 1)] if artifact == "contributions" else [log]

    @property
    def thresholded(self) -> str:
        """The file that the pruning factors apply to: weights, or opacities if clusters ignore weights."""
        uses_weights = "weight" in self.settings["cluster_on"]
        return self.path("weights.npy") if uses_weights else f"{self.model.folder}/opacities.npy"


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
    def code(self) -> str:
        """A digest of the code of its attack."""
        return code_digest("gspure.cli.attack", self.attack.function.__module__)

    @property
    def decision(self) -> Decision:
        """The decision that its attack uses."""
        return Decision(self.model, self.settings.get("decision", DEFAULT))

    @property
    def evidence(self) -> dict[str, str]:
        """The files that its attack needs beside the model."""
        files = {name: f"{self.model.folder}/{name}.npy" for name in ("opacities", "surface")}
        files |= {name: self.decision.path(f"{name}.npy") for name in ("weights", "prune_mask")}
        if "labels" in self.attack.needs:
            files |= {"labels": self.decision.path("clusters.npz"), "weights": self.decision.thresholded}
        return {need: files[need] for need in sorted(self.attack.needs)}

    @property
    def cost_options(self) -> str:
        """Where to write the cost of its attack, and the costs of the jobs that measure the evidence, as options."""
        artifacts = dict.fromkeys(artifact for need in sorted(self.attack.needs) for artifact in MEASURED[need])
        measured = [cost_of(log) for artifact in artifacts for log in self.decision.logs(artifact)]
        files = {"cost": cost_of(f"{self.folder.replace('results', COSTS, 1)}/attack"), "measured": measured or None}
        return options(files, *files)

    @property
    def render_files(self) -> dict[str, str]:
        """The public views, if its attack renders them; to search its strength, also any photographs of the scene."""
        is_searched = "damage" in self.settings
        cameras = {"cameras": f"{self.model.folder}/cameras.json"}
        photographs = {"photographs": self.model.pair["scene"]} if self.model.is_watermarked and is_searched else {}
        return {**cameras, **photographs} if is_searched or "cameras" in self.attack.parameters else {}

    @property
    def seed(self) -> int:
        """Random seed of its attack."""
        return int(self.settings["seed"]) + repetition_of(self.model.scene)

    @property
    def attack_settings(self) -> Settings:
        """Settings of its attack without a searched strength; unset factors of a built-in one are its decision's."""
        factors = {name: self.decision.settings[name] for name in FACTORS}
        factors = {**factors, "tau": factors["tau_n"]} if self.attack in BUILT_IN else {}
        values = {**factors, **self.settings}
        searched = self.attack.strength.setting if "damage" in self.settings and self.attack.strength else ""
        return {name: value for name, value in values.items() if name in {*self.attack.settings} - {searched}}

    @property
    def attack_options(self) -> str:
        """Evidence, seed, scheme and settings of its attack as options."""
        known = {**self.evidence, **self.render_files, "seed": self.seed}
        if "damage" in self.settings and self.attack.strength:
            known |= {"damage": self.settings["damage"], "split": self.model.plan.config["views"]["evaluate"]}
        return f"{options(known, *known)} {self.model.scheme_option} {repeated('--set', self.attack_settings)}"

    @property
    def public(self) -> str:
        """The model that it shows."""
        if self.name == OTHER_SCENE:
            return f"results/{self.model.scheme}/{self.model.other_pair}/public/point_cloud.ply"
        if self.name == WRONG_KEY:
            return self.model.public
        if self.name == CLEAN and not self.model.is_watermarked:
            return Model(self.model.plan, VANILLA, self.model.settings["clean"]).public
        return f"{self.folder}/public/point_cloud.ply"

    def view_files(self, target: str) -> dict[str, str]:
        """Return the views that show a target, and the attack's rigid transform.

        Instead of the transform, an owner who adapts gets the published model, and photographs to fit to.
        """
        files = self.model.views(target)
        if target != ADAPTIVE:
            return files | ({"transform": f"{self.folder}/transform.npy"} if self.is_attacked else {})
        fits = self.model.plan.schemes[self.model.scheme].fits
        return files | {"original": self.model.public} | ({"photographs": self.model.pair["message"]} if fits else {})

    def view_options(self, target: str) -> str:
        """Return the same as options."""
        files = self.view_files(target)
        return options(files, *files)

    def extraction_options(self, target: str) -> str:
        """Return scheme, extraction and key as options."""
        return f"{self.model.scheme_option} --extraction {target}{self._control_key}"

    @property
    def _control_key(self) -> str:
        return " --wrong-key 1" if self.name == WRONG_KEY else " --control" if self.name in MESSAGE_FREE else ""

    def detection_options(self, detector: str) -> str:
        """Return the settings of a detector, or the key of hidden bits, as options."""
        if detector == BITS:
            return f"{self.model.scheme_option} --key {self.model.folder}/key{self._control_key}"
        settings = self.model.plan.config["detectors"][detector]
        return options(settings, *(name for name in settings if settings[name]))

    @property
    def renders(self) -> list[str]:
        """The folders of its images; of a baseline those of the unattacked model, whose views it covers.

        Of controls that show a watermarked model, only the message is of interest.
        """
        targets = self.model.targets[1:] if self.name in (WRONG_KEY, OTHER_SCENE) else self.model.targets
        folder = f"{self.model.folder}/unattacked" if self.name in BASELINES else self.folder
        return [f"{folder}/renders/{target}" for target in targets]

    @property
    def comparison_options(self) -> str:
        """The targets of its images and their references as options: extractions are compared with the message."""
        targets = ["--targets", *(folder.rpartition("/")[2] for folder in self.renders)]
        reference = ["--reference", "render" if self.model.scheme == VANILLA else "truth"]
        against = [f"--against {target}=message" for target in self.model.targets[2:]]
        baseline = [f"--baseline {self.name}"] if self.name in BASELINES else []
        return " ".join([*targets, *reference, *against, *baseline])
