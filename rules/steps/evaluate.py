"""Evaluate variants or controls of a model: attack, render, extract, read marks, and compare with the references."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import Float32, Float64, save_array
from gspure.attacks import Attacked, Measurements, NotApplicable, affected, find_attack
from gspure.attacks.attacked import Retouch
from gspure.attacks.strength import scene_damage
from gspure.cameras import Camera
from gspure.cameras.photographs import photograph
from gspure.cameras.splits import read_split
from gspure.files import write_json
from gspure.images import read_back, write_image
from gspure.method.purify import purify
from gspure.method.weights import evenly_spread
from gspure.metrics.comparison import RENDER, TRUTH, ImagePair, Reference, compare, write_metrics
from gspure.metrics.csv_tables import write_table
from gspure.metrics.detection import DETECTIONS
from gspure.metrics.readings import Reading, read_marks
from gspure.metrics.retrieval import Retrieved, retrieved
from gspure.metrics.targets import ADAPTIVE, MESSAGE, SCENE, is_picture
from gspure.opencl.device import choose_device
from gspure.progress import track
from gspure.provenance import write_provenance
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.matching import registered
from gspure.schemes.pair import Capture
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.schemes.scheme import FIT_STEPS, Key
from gspure.settings import parsed_settings
from gspure.training.dataset import read_photographs
from gspure.workflow.step import run


def evaluate(
    variants: dict[str, dict[str, Any]],  # `gspure.workflow.variants.Variant.evaluation`
    cameras: Path,
    split: str,
    photographed: list[str],
    unattacked: Path,
    decoys: list[Path],
    scheme: str | None = None,
    key: Path | None = None,
    message_cameras: Path | None = None,
    published: Path | None = None,
    photographs: Path | None = None,
    listed: Path | None = None,
) -> None:
    views = {SCENE: read_split(cameras, split)} | (
        {MESSAGE: read_split(message_cameras, split)} if message_cameras else {}
    )
    owners = find_scheme(scheme).read_key(key) if scheme and key else None
    original = read_public_model(published, scheme).drawn(published).model if published else None
    for name, variant in variants.items():
        renders = (folder := Path(variant["folder"])) / "renders"
        shutil.rmtree(renders, ignore_errors=True)
        renders.mkdir(parents=True)
        (folder / DETECTIONS).mkdir(exist_ok=True)
        transform, model, retouched = np.eye(4), Path(variant["model"]), Attacked.retouched
        if variant["attack"]:
            how = {**variant["attack"], "scheme": scheme, "photographed": SCENE in photographed}
            if not (attacked := attack(folder, read_split(cameras, "train"), views[SCENE], **how)):
                write_metrics(folder / "metrics.csv", [])
                write_table(folder / "retrieval.csv", Retrieved, [])
                continue
            public, transform, is_removed, retouched = attacked
            # a removed format is vanilla 3DGS, which no extraction of the scheme reads
            variant.update({"rendered": [SCENE], "compared": [SCENE]} if is_removed else {})
        else:
            public = read_public_model(model, scheme)
        its_key = owners.wrong(np.random.default_rng(1)) if owners and variant["wrong_key"] else owners
        if variant["purified"]:
            public = purified(public.drawable(model), read_split(cameras, "train"), folder, variant["purified"])
        for target in variant["rendered"]:
            moves = transform if target != ADAPTIVE else np.eye(4)
            moved = [view.moved(moves) for view in views[kind(target)]]
            if target == SCENE:
                drawable = public.drawable(model)
                images: Iterator[Float32] = map(drawable.scene(choose_device(), drawable.model.background), moved)
            elif its_key:
                images = extraction(public.drawn(model), its_key, target, moved, original, photographs)
            for camera, image in zip(track(moved, target), images, strict=True):
                shown = retouched(read_back(image), camera.name) if target == SCENE else image
                write_image(renders / target / f"{camera.name}.png", shown)
        for detector, of_user in variant["detectors"].items():
            write_table(folder / DETECTIONS / f"{detector}.csv", Reading, read(its_key, of_user, renders / SCENE))
        shown_in = unattacked if variant["baseline"] else renders
        pairs = {t: paired(t, views, shown_in, photographed, unattacked) for t in sorted(variant["compared"])}
        references: dict[str, Reference] = {t: TRUTH if kind(t) in photographed else RENDER for t in pairs}
        rows = [compare(pair, references[t], variant["baseline"]) for t, of in pairs.items() for pair in of]
        if rows:
            write_metrics(folder / "metrics.csv", rows)
        seen = {target: pairs[target] for target in filter(is_picture, variant["rendered"])}
        write_table(folder / "retrieval.csv", Retrieved, [*retrieved(name, seen, decoys)])
        write_provenance(folder, "evaluate", inputs={"model": model}, settings=variant)
    if listed:
        write_json(listed, [*variants])


def attack(
    folder: Path, public_views: list[Camera], shown: list[Camera], *, name: str, model: str, **how: Any
) -> tuple[PublicModel, Float64, bool, Retouch] | None:
    """Attack a public model; the verdict tells what the attack changed, or why it cannot apply.

    Return the attacked model, how it moved, whether no extraction can read it, and what retouches renders of the scene;
    None if the attack cannot apply.
    """
    (folder / "public").mkdir(exist_ok=True)
    known, before = find_attack(name), read_public_model(model, how["scheme"]).drawable(model)
    texts = {key: str(value) for key, value in how.pop("settings").items()}
    used: dict[str, Any] = parsed_settings(f"attack {name}", known.function, texts)
    measurements = Measurements.read(before, {need: Path(file) for need, file in how["measured"].items()})
    learns, search = "teacher" in known.parameters, None
    do = {"seed": how["seed"], "cameras": public_views * learns, "device": choose_device() if learns else None}
    try:
        if "damage" in how:
            truth = read_photographs(shown, before.model.background) if how["photographed"] else None
            measure = scene_damage(before, shown, truth, choose_device())
            search = known.matching(before, measurements, how["damage"], measure, **do, **used)
            used[search.setting] = search.value
        attacked = known.apply(before, measurements, **do, **used)
        if not len(attacked.model):
            raise NotApplicable(name, f"none of {attacked.count} rows would remain")  # noqa: TRY301
    except NotApplicable as error:
        print(error)
        write_json(folder / "verdict.json", {"not applicable": error.reason})
        save_array(folder / "prune_mask.npy", np.zeros(len(before.model), np.bool_))
        return None
    published = attacked.published(before, search.comment(how["damage"]) if search else "")
    published.write(folder / "public" / "point_cloud.ply")
    save_array(folder / "prune_mask.npy", attacked.prune_mask)
    used = {**known.settings, **used}
    strength = f"{known.strength.setting}={used[known.strength.setting]:.4g}" if known.strength else ""
    if search and search.misses(how["damage"]):
        strength += f", {search.damage:z.2f} dB reached"
    reads = find_scheme(how["scheme"]).extractions if how["scheme"] else {}
    reached = {extraction: affected(before.model, attacked, columns) for extraction, columns in reads.items()}
    reached |= {extraction: True for extraction in reads if known.of_renders and not is_picture(extraction)}
    write_json(folder / "verdict.json", {"reached": reached, "strength": strength, "removed": attacked.removed})
    settings = {"attack": name, **used, **how}
    write_provenance(folder / "public", "attack", inputs={"model": Path(model)}, settings=settings)
    print(f"{name}: kept {int((~attacked.prune_mask).sum())} of {attacked.count} rows, {len(attacked.model)} in all")
    transform = np.eye(4) if attacked.transform is None else attacked.transform
    return published, transform, bool(attacked.removed), attacked.retouched


def extraction(
    public: PublicModel, key: Key, target: str, views: list[Camera], original: Any, photographs: Path | None
) -> Iterator[Float32]:
    """Yield what an extraction shows in views; an owner who adapts has the published model, perhaps photographs."""
    if target == ADAPTIVE:
        public = registered(public, original)
        if photographs:
            capture = Capture.read(photographs)
            taken = [camera.moved(np.eye(4)) for camera in capture.views]
            lesson = Lesson(taken, capture.images, (), FIT_STEPS, np.random.default_rng(0), device=choose_device())
            key = key.fitted(public, lesson)
    return key.images(public, target, views, choose_device())


def purified(public: PublicModel, views: list[Camera], folder: Path, how: dict[str, Any]) -> PublicModel:
    """Return a model without the rows that GSPure prunes, and save their mask."""
    views = evenly_spread(views, how["views"]) if how["views"] else views
    settings = {name: how[name] for name in how.keys() - {"views", "cluster_on"}}
    pruned = purify(public, views, device=choose_device(), **settings)
    save_array(folder / "prune_mask.npy", pruned.prune_mask)
    return public.with_model(pruned.model)


def read(key: Key | None, settings: dict[str, Any], images: Path) -> list[Reading]:
    """Return what a detector reads from images: the user's command, or the key of a scheme that hides bits."""
    if key and not settings:
        return key.readings(images)
    return read_marks(settings["command"], images, settings["message"], settings["timeout"])


def kind(target: str) -> str:
    """Return whose views a target has: the scene, or the message."""
    return SCENE if target == SCENE else MESSAGE


def paired(
    target: str, views: dict[str, list[Camera]], renders: Path, photographed: list[str], unattacked: Path
) -> list[ImagePair]:
    """Return the renders of a target, with the photographs of their views or renders of the unattacked model."""
    of = kind(target)
    references = [photograph(v) if of in photographed else unattacked / of / f"{v.name}.png" for v in views[of]]
    files = [renders / target / f"{view.name}.png" for view in views[of]]
    return [ImagePair(target, *each) for each in zip((view.name for view in views[of]), references, files, strict=True)]


run(evaluate)
