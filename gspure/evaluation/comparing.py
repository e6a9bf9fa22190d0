"""What the images of a job say: metrics of scene and message, and the evidence that the message is there."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, nan

import numpy as np

from gspure.arrays import Float32, load_array, save_array
from gspure.attacks.strength import scene_renders
from gspure.cameras import Camera
from gspure.cameras.photographs import photograph
from gspure.evaluation.evidence import Evidence, SceneChange, evidence_of
from gspure.evaluation.plan import AttackSpec, Job, kind_of
from gspure.evaluation.showing import Exhibit, extraction
from gspure.images import read_back, read_image
from gspure.metrics.bit_evidence import BitEvidence, bit_evidence
from gspure.metrics.comparison import RENDER, TRUTH, ImagePair, Reference, ViewMetrics, compare
from gspure.metrics.damage import Shown, coverage_lost, damage, fidelity
from gspure.metrics.proof import compared_views, trace
from gspure.metrics.readings import Reading, as_digits
from gspure.metrics.targets import ADAPTIVE, MESSAGE, SCENE, is_picture
from gspure.opencl.device import choose_device
from gspure.public_model import PublicModel
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Key
from gspure.training.dataset import read_photographs


def image_pairs(job: Job, exhibit: Exhibit, views: Mapping[str, Sequence[Camera]]) -> dict[str, list[ImagePair]]:
    """Return the renders of each compared target, each with its photograph or its render before the attack."""
    renders = job.folder / "renders"
    pairs: dict[str, list[ImagePair]] = {}
    for target in sorted(exhibit.compared):
        kind = kind_of(target)
        pairs[target] = []
        for view in views[kind]:
            unattacked = job.views.unattacked / kind / f"{view.name}.png"
            reference = photograph(view) if kind in job.views.photographed else unattacked
            pairs[target].append(ImagePair(target, view.name, reference, renders / target / f"{view.name}.png"))
    return pairs


def compared(job: Job, pairs: Mapping[str, Sequence[ImagePair]]) -> Iterator[ViewMetrics]:
    """Yield the metrics of every view of every compared target."""
    for target, images in pairs.items():
        reference: Reference = TRUTH if kind_of(target) in job.views.photographed else RENDER
        for pair in images:
            yield compare(pair, reference)


def picture_evidence(
    job: Job,
    exhibit: Exhibit,
    views: Mapping[str, Sequence[Camera]],
    key: Key | None,
    pairs: Mapping[str, Sequence[ImagePair]],
) -> dict[str, Evidence]:
    """Return how well each extraction shows the message, beside candidates and redrawn twins."""
    if job.owner is None or key is None:
        return {}
    candidates = None
    if job.owner.candidates:
        candidates = load_array(job.owner.candidates, dtype=np.uint8, shape=(None, None, None, None, 3))
    shown = {}
    messages = {}
    for target in filter(is_picture, exhibit.rendered):
        if target in pairs:
            shown[target] = [read_image(pair.image) for pair in pairs[target]]
            size = (shown[target][0].shape[1], shown[target][0].shape[0])
            messages[target] = [read_image(pair.reference, size) for pair in pairs[target]]
    # A key that learns would have to learn from each twin, which takes as long as the attacks: clean models test it.
    fitted = {ADAPTIVE} if job.owner.photographs else set()
    judged = {target: truth for target, truth in messages.items() if target not in fitted}
    twins = twin_traces(job, exhibit, key, views[MESSAGE], judged)
    return {
        target: evidence_of(
            extractions, messages[target], candidates, twins.get(target, ()), is_fitted=target in fitted
        )
        for target, extractions in shown.items()
    }


def twin_traces(
    job: Job, exhibit: Exhibit, key: Key, views: Sequence[Camera], messages: Mapping[str, Sequence[Float32]]
) -> dict[str, list[float]]:
    """Return the traces of each target's message in models like this one, whose carriers of it are drawn again."""
    if job.owner is None or not isinstance(job.case, AttackSpec):
        return {}
    scheme = find_scheme(job.owner.scheme)
    chosen = compared_views(len(views))
    traces: dict[str, list[float]] = {target: [] for target in messages}
    for seed in range(job.owner.twins if messages else 0):
        twin = scheme.redrawn(exhibit.public, np.random.default_rng(seed))
        if twin is None:
            break
        drawn = twin.drawn(exhibit.source)
        for target, truth in messages.items():
            transform = np.eye(4) if target == ADAPTIVE else exhibit.transform
            moved = [views[view].moved(transform) for view in chosen]
            images = [read_back(image) for image in extraction(job, drawn, key, target, moved)]
            traces[target].append(trace(images, [truth[view] for view in chosen]))
    return traces


def scene_before(job: Job, public: PublicModel, views: Sequence[Camera], after: Shown) -> Shown:
    """Return what the scene of a `public` model shows before a job's attack; `after` is what it shows after it.

    The job without an attack writes what its renders cover beside them; jobs with attacks read both.
    """
    renders = job.views.unattacked
    covered_file = renders / "covered.npy"
    if job.folder / "renders" == renders:
        save_array(covered_file, np.concatenate([mask.ravel() for mask in after.covered]))
        return after
    if renders not in job.inputs:
        return scene_renders(public, views, choose_device())
    images = [read_image(renders / SCENE / f"{view.name}.png") for view in views]
    sizes = [image[..., 0].size for image in images]
    covered = np.split(load_array(covered_file, dtype=np.bool_, shape=(sum(sizes),)), np.cumsum(sizes)[:-1])
    return Shown(images, [mask.reshape(image.shape[:2]) for mask, image in zip(covered, images, strict=True)])


def scene_change(job: Job, public: PublicModel, views: Sequence[Camera], after: Shown) -> SceneChange:
    """Return what an attack did to the scene of a `public` model; `after` is what the attacked one shows."""
    before = scene_before(job, public, views, after)
    drop = nan
    if SCENE in job.views.photographed:
        drop = damage(read_photographs(views, public.model.background), before, after)
    level = fidelity(before, after)
    return SceneChange(
        damage=drop if isfinite(drop) else None,
        fidelity=level if isfinite(level) else None,
        coverage_lost=coverage_lost(before, after),
    )


def bits_evidence(job: Job, key: Key | None, marks: Mapping[str, Sequence[Reading]]) -> dict[str, BitEvidence]:
    """Return what the majority of the views shows of the bits of each detector, and of the key."""
    messages = {name: detector.message for name, detector in job.detectors.items()}
    if key is not None:
        messages |= dict.fromkeys(job.bit_targets, as_digits(key.bits))
    return {name: bit_evidence(rows, messages[name]) for name, rows in marks.items() if messages.get(name)}
