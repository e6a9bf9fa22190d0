"""From a configuration to the plan of its run: names are looked up, files are found, every job is listed."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from gspure.attacks.attack import Attack
from gspure.cameras import GENERATED
from gspure.codec import plain
from gspure.constants import TAU_C, TAU_N
from gspure.errors import InputError
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.plan import (
    METHOD,
    CameraSource,
    Candidates,
    Embedding,
    ModelPlan,
    Owner,
    Plan,
    Preparation,
    Views,
)
from gspure.metrics.names import UNATTACKED, clean_model
from gspure.metrics.targets import ADAPTIVE, HIDDEN_BITS, MESSAGE, SCENE, is_picture
from gspure.schemes.registry import find_scheme, schemes
from gspure.schemes.scheme import Scheme
from gspure.workflow.assets import Asset, Clean, read_assets
from gspure.workflow.config import AssetConfig, Config
from gspure.workflow.decisions import SettingsByDecision, attack_groups, decisions_of, factors_of, suited, sweeps
from gspure.workflow.inputs import camera_files, capture_files, distinct, model_files
from gspure.workflow.jobs import Subject, control_job, controls_of, variant_job
from gspure.workflow.pairs import PlannedPair, candidates_of_message, message_training, pair_training, planned_pair
from gspure.workflow.variants import VariantSpec, check_schemes, read_detectors, read_variants

VANILLA: Final = "vanilla"  # folder of the user's own models without a key
PLAIN_READER: Final = "gspure.public_model"  # module that reads models of vanilla 3DGS


def plan_of(config: Config, source: str) -> Plan:
    """Return the plan of a configuration, or raise `InputError` for the first entry that no job could use."""
    if not config.assets and not (config.pairs and config.schemes):
        raise InputError(source, "assets", expected="at least one model, or a pair and a scheme", found="none")
    variants = dict(sorted(read_variants(config, source).items()))  # tables list them by name
    check_schemes(config, source)
    pairs = {name: planned_pair(name, pair, source) for name, pair in config.pairs.items()}
    planner = _Planner(config, source, variants, pairs)
    settings = planner.decision_settings(None)
    models = tuple(planner.models())
    candidates = [*filter(None, map(planner.candidates, pairs.values())), *planner.of_messages.values()]
    factors = {
        name: factors_of(variants, planner.decision_settings(scheme)) for name, scheme in planner.schemes.items()
    }
    return Plan(
        models=models,
        pairs={name: pair_training(pair) for name, pair in pairs.items()},
        messages=dict(filter(None, map(message_training, pairs.values()))),
        trained={name: _training(asset) for name, asset in config.assets.items() if asset.train},
        candidates={known.name: known for known in candidates},
        sweeps=sweeps(variants, settings),
        attacks=attack_groups(variants, settings),
        factors={scheme: points for scheme, points in factors.items() if points},
        meanings={name: _meaning(variant.attack) for name, variant in variants.items()},
        suite=config.suite or "",
    )


def _meaning(attack: Attack) -> str:
    """Return what an attack does: the first line of its docstring, without marks of code and references."""
    first_line = (attack.function.__doc__ or "").partition("\n")[0]
    return re.sub(r" \((paper,|`gspure)[^)]*\)|`", "", first_line)


class _Planner:
    """The models of a configuration."""

    def __init__(
        self, config: Config, source: str, variants: Mapping[str, VariantSpec], pairs: Mapping[str, PlannedPair]
    ) -> None:
        self.config = config
        self.variants = variants
        self.pairs = pairs
        self.assets = read_assets(config, source)
        self.clean_assets = {asset.config.clean for asset in self.assets.values()}
        of_keys = [asset.scheme for asset in self.assets.values() if asset.scheme]
        self.schemes = {name: find_scheme(name) for name in dict.fromkeys([*config.schemes, *of_keys])}
        self.of_messages: dict[str, Candidates] = {}
        self.detectors = read_detectors(config, source)

    def decision_settings(self, scheme: Scheme | None) -> SettingsByDecision:
        """Return the settings of every decision, that of the method first, with the factors that suit a scheme."""
        every = {METHOD: self.config.method, **self.config.decisions}
        return suited(every, scheme.tau_c, scheme.tau_n) if scheme else suited(every, TAU_C, TAU_N)

    def candidates(self, pair: PlannedPair) -> Candidates | None:
        """Return the pictures of the kind of a pair's message, in the views that are compared."""
        return pair.candidates(self.config.proof.candidates, self.config.views.evaluate)

    def candidates_of(self, message: Path) -> Candidates | None:
        """Return the pictures of the kind of a user's message, if it is that of a ray-traced pair."""
        proof = self.config.proof
        known = candidates_of_message(message, proof.candidates, self.config.views.evaluate)
        if known:
            self.of_messages[known.name] = known
        return known

    def models(self) -> Iterator[ModelPlan]:
        """Yield the user's models without a key, then for each scheme those with one, and its models of all pairs."""
        for name, asset in self.assets.items():
            if not asset.scheme:
                yield self._of_asset(name, asset, None)
        for scheme in self.schemes.values():
            for name, asset in self.assets.items():
                if asset.scheme == scheme.name:
                    yield self._of_asset(name, asset, scheme)
            if scheme.name in self.config.schemes:
                for pair in self.pairs.values():
                    for seed in range(self.config.repetitions):
                        yield self._of_pair(scheme, pair, seed)

    def _targets(self, scheme: Scheme | None) -> tuple[str, ...]:
        """Return what is compared: the scene, and the extractions of the message that the configuration names."""
        available = scheme.extractions if scheme else ()
        wanted = self.config.extractions or available
        return (SCENE, *(name for name in available if name in wanted and is_picture(name)))

    def _with_jobs(self, model: ModelPlan, subject: Subject) -> ModelPlan:
        """Return a model with its jobs."""
        return replace(
            model,
            variants=tuple(variant_job(subject, name, variant) for name, variant in self.variants.items()),
            controls=tuple(control_job(subject, name) for name in controls_of(subject)),
        )

    def _of_asset(self, name: str, asset: Asset, scheme: Scheme | None) -> ModelPlan:
        """Return the plan of a user's model."""
        identity = ModelId(scheme.name if scheme else VANILLA, name)
        trained = identity.folder / "trained" / "cameras.json"
        public = asset.model or identity.folder / "public" / "point_cloud.ply"
        cameras = {SCENE: camera_source(asset, asset.config.cameras or str(trained))}
        sources = [cameras[SCENE].source]
        photographed: tuple[str, ...] = (SCENE,) if asset.has_photographs else ()
        if scheme:
            cameras[MESSAGE] = cameras[SCENE]
        if scheme and asset.config.message:
            photographed += (MESSAGE,)
            cameras[MESSAGE] = CameraSource(asset.config.message, "photographs")
            sources.append(asset.config.message)
        targets = self._targets(scheme)
        owner = None
        if scheme and asset.config.key:
            message = Path(asset.config.message) if asset.config.message else None
            owner = owner_of(scheme, identity, Path(asset.config.key), public, targets, message)
            owner = replace(owner, twins=self.config.proof.twins)
            candidates = self.candidates_of(message) if message and not owner.bit_targets else None
            if candidates:
                owner = replace(owner, candidates=candidates.file)
        model = ModelPlan(
            id=identity,
            public=public,
            modules=scheme.modules if scheme else plain_readers(),
            cameras=cameras,
            decisions=decisions_of(self.decision_settings(scheme), identity.folder),
            variants=(),
            owner=owner,
            condition=Condition(identity.scheme),
            targets=targets,
            inputs=() if asset.model else (public,),
            users_files=distinct((*asset.files, *(scheme.sources if scheme else ()))),
            camera_inputs=() if asset.model else (trained,),
            camera_files=users_camera_files(sources) if asset.model else (),
        )
        inputs = [identity.folder / "cameras.json", *model.inputs]
        if owner:
            inputs.append(owner.message_cameras)
            inputs += [owner.candidates] if owner.candidates else []
        return self._with_jobs(model, self._subject(model, photographed, tuple(inputs), self._clean_of(asset)))

    def _clean_of(self, asset: Asset) -> Clean | None:
        """Return the clean model of a user's model."""
        if asset.config.clean is None:
            return None
        clean = self.assets[asset.config.clean]
        trained = ModelId(VANILLA, asset.config.clean).folder / "public" / "point_cloud.ply"
        return Clean((clean.model,), model_files(clean.model)) if clean.model else Clean((trained,))

    def _of_pair(self, scheme: Scheme, pair: PlannedPair, seed: int) -> ModelPlan:
        """Return the plan of a scheme's model of a pair."""
        identity = ModelId(scheme.name, pair.name, seed)
        others = [known for known in self.pairs.values() if known.message_identity != pair.message_identity]
        public = identity.folder / "public" / "point_cloud.ply"
        targets = self._targets(scheme)
        owner = owner_of(scheme, identity, identity.folder / "key", public, targets, pair.folder / "message")
        candidates = self.candidates(pair)
        if candidates and not owner.bit_targets:
            owner = replace(owner, candidates=candidates.file)
        owner = replace(owner, twins=self.config.proof.twins)
        entry = self.config.schemes[scheme.name]
        model = ModelPlan(
            id=identity,
            public=public,
            modules=scheme.modules,
            cameras={
                SCENE: CameraSource(str(pair.folder / "cameras.json"), "native"),
                MESSAGE: CameraSource(str(pair.folder / "message"), "native"),
            },
            decisions=decisions_of(self.decision_settings(scheme), identity.folder),
            variants=(),
            owner=owner,
            embedding=Embedding(pair.folder, pair.config.initialization, entry.seed + seed, entry.settings, pair.files),
            condition=Condition(scheme.name, pair.config.protocol, pair.config.initialization),
            targets=targets,
            photographs=pair.folder,
            inputs=(public,),
            users_files=distinct(scheme.sources),
            camera_inputs=(pair.folder / "cameras.json", pair.folder / "message"),
            has_small_images=pair.has_small_images,
        )
        inputs = [identity.folder / "cameras.json", public, owner.key, owner.message_cameras]
        if owner.candidates:
            inputs.append(owner.candidates)
        inputs += [pair.folder / "scene", pair.folder / "message"]
        names = [clean_model(number + 1) for number in range(entry.clean_models)]
        clean = Clean(tuple(identity.folder / name / "public" / "point_cloud.ply" for name in names))
        subject = self._subject(model, (SCENE, MESSAGE), tuple(inputs), clean)
        if others:
            other_folder = ModelId(scheme.name, others[0].name).folder
            subject = replace(subject, other_scene=other_folder / "public" / "point_cloud.ply")
        return self._with_jobs(model, subject)

    def _subject(
        self, model: ModelPlan, photographed: tuple[str, ...], inputs: tuple[Path, ...], clean: Clean | None
    ) -> Subject:
        """Return what the jobs of a model have in common."""
        folder = model.folder
        return Subject(
            id=model.id,
            public=model.public,
            modules=model.modules,
            decisions=model.decisions,
            views=Views(
                cameras=folder / "cameras.json",
                split=self.config.views.evaluate,
                unattacked=folder / UNATTACKED / "renders",
                photographed=photographed,
            ),
            targets=model.targets,
            owner=model.owner,
            detectors=self.detectors,
            is_clean=model.embedding is None and model.id.scene in self.clean_assets,
            clean=clean.public if clean else (),
            clean_files=clean.files if clean else (),
            inputs=inputs,
            users_files=model.users_files,
            compares_with_renders=model.embedding is None,
        )


def plain_readers() -> tuple[str, ...]:
    """Return the modules that read a model of no named scheme, which may be of any scheme with a signature."""
    signed = [scheme for scheme in schemes().values() if scheme.signature]
    return tuple(dict.fromkeys((PLAIN_READER, *(module for scheme in signed for module in scheme.modules))))


def owner_of(
    scheme: Scheme, identity: ModelId, key: Path, public: Path, targets: tuple[str, ...], message: Path | None
) -> Owner:
    """Return what the owner of a model has; `message` are photographs of the message, if there are any."""
    bit_targets = tuple(name for name in HIDDEN_BITS if name in scheme.extractions)
    adapts = ADAPTIVE in targets
    return Owner(
        scheme=scheme.name,
        key=key,
        message_cameras=identity.folder / "message_cameras.json",
        bit_targets=bit_targets,
        reveals=scheme.reveals and not bit_targets,
        published_model=public if adapts else None,
        photographs=message if adapts and scheme.fits else None,
    )


def camera_source(asset: Asset, source: str) -> CameraSource:
    """Return the source of the scene's views of a user's model."""
    if source not in GENERATED:
        return CameraSource(source, asset.config.resolution)
    generated = {name: value for name, value in plain(asset.config.generated).items() if value is not None}
    generated["fov_degrees"] = generated.pop("fov")
    return CameraSource(source, "native", generated)


def users_camera_files(sources: Iterable[str]) -> tuple[Path, ...]:
    """Return the files of cameras that are not generated."""
    return distinct(file for source in sources if source not in GENERATED for file in camera_files(source))


def _training(asset: AssetConfig) -> Preparation:
    """Return how a model of the user's photographs is trained."""
    source = asset.train or ""
    return Preparation((source,), plain(asset.training), capture_files(source))
