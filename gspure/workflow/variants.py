"""The variants and negative controls of a model: what each job attacks, renders, reads and compares."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gspure.attacks import BUILT_IN, find_attack
from gspure.attacks.attack import Attack
from gspure.evaluation.collecting import ModelPlan
from gspure.external import files_of
from gspure.metrics.names import BASELINES, CLEAN, CLEAN_GSPURE, OTHER_SCENE, UNATTACKED, WRONG_KEY
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE, SCENE
from gspure.report.writing import ReportPlan
from gspure.workflow.decisions import FACTORS, METHOD, Settings, factors_of, kinds, sweeps
from gspure.workflow.inputs import model_files
from gspure.workflow.plan import VANILLA, Model, Plan


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
        """The files that its attack needs beside the model; weights, masks and labels are those of its decision."""
        model, decision = self.model, self.settings.get("decision", METHOD)
        files = {"opacities": model.path("opacities.npy"), "surface": f"{model.folder}/surface.npy"}
        files |= {name: model.path(f"{name}.npy", decision) for name in ("weights", "prune_mask")}
        if "labels" in self.attack.needs:
            files |= {"labels": model.path("clusters.npz", decision), "weights": model.thresholded(decision)}
        return {need: files[need] for need in sorted(self.attack.needs)}

    @property
    def attacked_by(self) -> dict[str, Any]:
        """Name, model, measurements, seed, damage and settings of its attack; none of a searched strength.

        Unset factors of a built-in attack are its decision's.
        """
        attack, own = self.attack, self.settings
        decision = self.model.decision(own.get("decision", METHOD))
        factors = {name: decision[name] for name in FACTORS} | {"tau": decision["tau_n"]}
        searched = attack.strength.setting if "damage" in own and attack.strength else ""
        values = {**(factors if attack in BUILT_IN else {}), **own}
        return {
            "name": attack.name,
            "model": self.model.public,
            "measured": self.measured,
            "seed": own["seed"] + self.model.repetition,
            "settings": {name: value for name, value in values.items() if name in {*attack.settings} - {searched}},
            **({"damage": own["damage"]} if searched else {}),
        }

    @property
    def public(self) -> str:
        """The model that it shows."""
        model = self.model
        if self.name == OTHER_SCENE:
            return f"results/{model.scheme}/{model.other_pairs[0]}/public/point_cloud.ply"
        if self.name in (CLEAN, CLEAN_GSPURE):
            trained = f"{model.folder}/{CLEAN}/public/point_cloud.ply"
            return Model(model.plan, VANILLA, model.settings["clean"]).public if model.is_users else trained
        if self.name in (WRONG_KEY, *BASELINES):
            return model.public
        return f"{self.folder}/public/point_cloud.ply"

    @property
    def targets(self) -> list[str]:
        """What is rendered of it; of controls that show a watermarked model, only the message is of interest."""
        if self.name == CLEAN_GSPURE:
            return [SCENE]
        shows_mark = self.name in (WRONG_KEY, OTHER_SCENE) and self.model.hides_picture
        return [] if self.name in BASELINES else self.model.targets[1:] if shows_mark else self.model.targets

    @property
    def detectors(self) -> dict[str, Settings]:
        """The detectors that read its renders: those of the user, also of clean models, and ``bits`` of hidden bits.

        Nothing is read from an asset that is the clean model of another one.
        """
        model, of_user = self.model, self.model.plan.config["detectors"]
        clean = {asset.get("clean") for asset in model.plan.scenes[model.scheme].values()}
        if self.name == CLEAN_GSPURE or model.scene in clean:
            return {}
        bits: dict[str, Settings] = {BITS: {}} if model.hides_bits else {}
        return {**(of_user if self.is_attacked or self.name == CLEAN else {}), **bits}

    @property
    def users_files(self) -> list[str]:
        """The user's files that its evaluation reads: those that detectors name, such as code, and a clean model."""
        files = [file for each in self.detectors.values() if each for file in files_of(each["command"])]
        is_users = self.name == CLEAN and self.model.is_users
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
            "attack": self.attacked_by if self.is_attacked else None,
            "baseline": self.name if self.name in BASELINES else None,
            "wrong_key": self.name == WRONG_KEY,
            "purified": self.model.decision(METHOD) if self.name == CLEAN_GSPURE else None,
            "detectors": self.detectors,
        }


def evaluation(model: Model, names: Sequence[str]) -> dict[str, Any]:
    """Return the settings of the job that evaluates some variants or controls of a model."""
    adapts = ADAPTIVE in model.targets
    fits = adapts and model.plan.schemes[model.scheme].fits
    message = model.views.get("message") if MESSAGE in model.photographed else None
    return {
        "cameras": f"{model.folder}/cameras.json",
        **(model.owned if model.is_watermarked else {}),
        "scheme": model.scheme if model.is_watermarked else None,  # else it is recognized by the columns
        "split": model.plan.config["views"]["evaluate"],
        "photographed": model.photographed,
        "unattacked": f"{model.folder}/{UNATTACKED}/renders",
        "published": model.public if adapts else None,
        "photographs": message if fits else None,
        "decoys": model.decoys,
        "variants": {name: Variant(model, name).evaluation for name in names},
    }


def reported(model: Model) -> ModelPlan:
    """Return what the report shows of a model."""
    shown = [Variant(model, name) for name in (*model.plan.config["variants"], *model.controls)]
    return ModelPlan(
        [v.name for v in shown if v.is_attacked],
        [v.name for v in shown if not v.is_attacked and v.evaluation["compared"]],
        model.targets,
        {v.name: [*v.detectors] for v in shown if v.detectors},
        None if model.is_users else Path(model.pair),
        model.settings.get("protocol", ""),
        model.settings.get("initialization", ""),
    )


def _meaning(attack: Attack) -> str:
    """Return what an attack does: the first line of its docstring, without marks of code and references."""
    return re.sub(r" \((paper,|`gspure)[^)]*\)|`", "", (attack.function.__doc__ or "").partition("\n")[0])


def report_plan(plan: Plan) -> ReportPlan:
    """Return what the report shows."""
    variants = plan.config["variants"]
    factors = {scheme: factors_of(variants, plan.decisions[scheme]) for scheme in plan.schemes}
    return ReportPlan(
        {f"{model.scheme}/{model.scene}": reported(model) for model in plan.models},
        sweeps(variants, plan.decisions[VANILLA]),
        {scheme: points for scheme, points in factors.items() if points},
        [Path("results/configuration.json"), Path("results/logs")],
        {name: _meaning(find_attack(settings["attack"])) for name, settings in variants.items()},
        kinds(variants, plan.decisions[VANILLA]),
    )
