"""Evaluate variants or controls of a model: render, extract, read marks, and compare all with the references."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras import Camera
from gspure.cameras.photographs import photograph
from gspure.cameras.reading import read_transform
from gspure.evaluation.comparison import RENDER, TRUTH, ImagePair, Reference, compare, write_metrics
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.detection import DETECTIONS, Reading, read_bits, read_marks
from gspure.evaluation.outcomes import MESSAGE, SCENE, is_picture
from gspure.evaluation.retrieval import Retrieved, retrieved
from gspure.files import read_json, save_array, write_json, write_provenance
from gspure.images import write_image
from gspure.method.purify import purify
from gspure.method.weights import evenly_spread
from gspure.opencl.device import choose_device
from gspure.progress import track
from gspure.public_model import Lesson, PublicModel, RenderView
from gspure.schemes.matching import registered
from gspure.schemes.pair import Capture
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.schemes.scheme import ADAPTIVE, FIT_STEPS, Key
from gspure.workflow.step import run, views_of


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
    views = {SCENE: views_of(cameras, split)} | ({MESSAGE: views_of(message_cameras, split)} if message_cameras else {})
    owners = find_scheme(scheme).read_key(key) if scheme and key else None
    original = read_public_model(published, scheme).drawn(published).model if published else None
    for name, variant in variants.items():
        renders = (folder := Path(variant["folder"])) / "renders"
        shutil.rmtree(renders, ignore_errors=True)
        renders.mkdir(parents=True)
        (folder / DETECTIONS).mkdir(exist_ok=True)
        verdict = read_json(folder / "verdict.json") if variant["attacked"] else {}
        if "not applicable" in verdict:
            write_metrics(folder / "metrics.csv", [])
            write_table(folder / "retrieval.csv", Retrieved, [])
            continue
        if is_removed := bool(verdict.get("removed")):  # vanilla 3DGS, which no extraction of the scheme reads
            variant |= {"rendered": [SCENE], "compared": [SCENE]}
        its_key = owners.wrong(np.random.default_rng(1)) if owners and variant["wrong_key"] else owners
        transform = read_transform(folder / "transform.npy") if variant["attacked"] else np.eye(4)
        public = read_public_model(model := Path(variant["model"]), None if is_removed else scheme)
        if variant["purified"]:
            public = purified(public.drawable(model), views_of(cameras, "train"), folder, variant["purified"])
        for target in variant["rendered"]:
            moves = transform if target != ADAPTIVE else np.eye(4)
            if target == SCENE:
                drawable = public.drawable(model)
                draw = drawable.scene(choose_device(), drawable.model.background)
            elif its_key:
                draw = extraction(public.drawn(model), its_key, target, original, photographs)
            for camera in track([view.moved(moves) for view in views[kind(target)]], target):
                write_image(renders / target / f"{camera.name}.png", draw(camera))
        for detector, of_user in variant["detectors"].items():
            write_table(folder / DETECTIONS / f"{detector}.csv", Reading, read(its_key, of_user, renders / SCENE))
        shown = unattacked if variant["baseline"] else renders
        pairs = {t: paired(t, views, shown, photographed, unattacked) for t in sorted(variant["compared"])}
        references: dict[str, Reference] = {t: TRUTH if kind(t) in photographed else RENDER for t in pairs}
        rows = [compare(pair, references[t], variant["baseline"]) for t, of in pairs.items() for pair in of]
        if rows:
            write_metrics(folder / "metrics.csv", rows)
        seen = {target: pairs[target] for target in filter(is_picture, variant["rendered"])}
        write_table(folder / "retrieval.csv", Retrieved, [*retrieved(name, seen, decoys)])
        write_provenance(folder, "evaluate", inputs={"model": model}, settings=variant)
    if listed:
        write_json(listed, [*variants])


def extraction(public: PublicModel, key: Key, target: str, original: Any, photographs: Path | None) -> RenderView:
    """Return the renderer of an extraction; an owner who adapts has the published model, and perhaps photographs."""
    if target == ADAPTIVE:
        public = registered(public, original)
        if photographs:
            capture = Capture.read(photographs)
            views = [camera.moved(np.eye(4)) for camera in capture.views]
            lesson = Lesson(views, capture.images, (), FIT_STEPS, np.random.default_rng(0), device=choose_device())
            key = key.fitted(public, lesson)
    return key.message(public, target, choose_device())


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
        return read_bits(key.read_bits, key.bits, images)
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
