"""How often wrong claims are proven, and whether right ones are: tables/wrong_claims.csv.

``python -m experiments.wrong_claims models FOLDER`` makes pictures, models and fitted keys of five pairs once, and
stores them. It needs PyTorch. ``python -m experiments.wrong_claims tables FOLDER`` judges all claims as an audit does,
and writes the table. Every claim is of one of these groups:

- ``marked``: the message of a marked model;
- ``wrong message``: another message of the same kind, on a marked model;
- ``fitted key``: a message on a model that never held it, by a key that learned it there from photographs;
- ``redrawn twin``: the message of a marked model, whose carriers were drawn again; the key may learn there, too;
- ``key made afterwards``: a message on a stranger's clean model, with a key that was made for this model.

A key made afterwards is the claimant's own key after `Key.fitted` on the stranger's model, presented as the published
one. Keys of Splats in Splats do not learn: there, the stranger's rows get hidden colours, trained to show the message.
"""

import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from gspure.arrays import Float32, UInt8, save_array
from gspure.cameras import Camera
from gspure.cli import main
from gspure.evaluation.evidence import Evidence, evidence_of
from gspure.evaluation.judging import judged
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.results import ADAPTS, READABLE
from gspure.evaluation.showing import fitted_key
from gspure.files import filling, write_text
from gspure.grouping import grouped
from gspure.images import read_back
from gspure.metrics.comparison import TRUTH, ViewMetrics
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.image_metrics import halved
from gspure.metrics.names import OTHER_SCENE, UNATTACKED
from gspure.metrics.proof import compared_views, trace, traces
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.model import Gaussians
from gspure.opencl.device import choose_device
from gspure.opencl.trainable import Parameters
from gspure.progress import track
from gspure.public_model import Lesson, PublicModel
from gspure.scenes.candidates import COARSENESS, Kind, candidate_cameras, candidates, kind_of
from gspure.scenes.lighting import bake
from gspure.scenes.photography import trace as photograph
from gspure.scenes.procedural import PROCEDURAL
from gspure.scenes.rooms import PLACEMENTS
from gspure.schemes.pair import Capture, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Key, hide
from gspure.schemes.splats_in_splats.bits import SHIFT
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping
from gspure.schemes.splats_in_splats.refining import refined
from gspure.training.dataset import read_photographs
from gspure.training.output import as_gaussians

TABLE = Path(__file__).resolve().parent / "tables" / "wrong_claims.csv"
VIEWS, WIDTH, HEIGHT = 64, 96, 72  # of a pair; eight views are held out, and traces compare four of these
PLACEMENT = "raised"
PAIRS = (  # scene and message
    ("interior-611", "interior-701"),
    ("landscape-612", "landscape-702"),
    ("interior-613", "interior-703"),
    ("object-614", "interior-704"),
    ("interior-615", "landscape-705"),
)
SCHEMES: dict[str, dict[str, Any]] = {
    "splats_in_splats": {"iterations": 700, "max_gaussians": 6000},
    "keyss": {"iterations": 400, "max_gaussians": 4000},
    "secure_gs": {"iterations": 450, "max_anchors": 2500},
    "secure_gs_hardened": {"iterations": 450, "max_anchors": 2500},
}
CLEAN_OF = {"keyss": "splats_in_splats", "secure_gs_hardened": "secure_gs"}  # schemes that share clean models
LEARNING = ("keyss", "secure_gs")  # schemes whose keys learn
CANDIDATES = 999  # of an audit for a publication; the default is 199
WRONG_MESSAGES = 200  # of each kind
FIRST_WRONG_SEED = 10_000  # no seed of `PAIRS` or of a candidate
FITTED_MESSAGES = (0,)  # that keys learn on all models that never held them
FITTED_TWINS = 2  # twins of each of these messages on which a key learns
TWINS = 8  # with which a claim is compared: the default of an audit
CLAIMED_TWINS = 10  # of each marked model
FIRST_TWIN_SEED = 100  # no seed of the twins with which claims are compared
REFINING_STEPS = 400  # of colours in a key made afterwards


def message_kind(number: int) -> Kind:
    """Return the kind of the message of a pair."""
    kind = kind_of(PAIRS[number][1], PLACEMENT)
    assert kind is not None
    return kind


def pair_folder(folder: Path, number: int) -> Path:
    """Return the folder of a pair; trace it unless it is stored."""
    place = folder / "pairs" / str(number)
    size = ("--views", str(VIEWS), "--width", str(WIDTH), "--height", str(HEIGHT))
    options = (*size, "--placement", PLACEMENT, "--out", str(place), "--quiet")
    assert place.is_dir() or main(("pair", *PAIRS[number], *options)) == 0
    return place


def candidates_of(folder: Path, builder: str) -> UInt8:
    """Return the candidates [N,V,H/2,W/2,3] of a kind; trace them unless they are stored."""
    file = folder / f"candidates-{builder}-{CANDIDATES}.npy"
    if not file.is_file():
        cameras = candidate_cameras(VIEWS, WIDTH, HEIGHT)
        save_array(file, candidates(Kind(builder, PLACEMENT), cameras, CANDIDATES))
    return np.asarray(np.load(file))


def wrong_messages(folder: Path, builder: str) -> Float32:
    """Return messages [N,V,H/2,W/2,3] of a kind that no model holds; photograph them unless they are stored.

    As of a message, photographs have full size, and finer light than candidates have.
    """
    file = folder / f"wrong-{builder}-{WRONG_MESSAGES}.npy"
    if not file.is_file():
        cameras = [camera.resized(WIDTH, HEIGHT) for camera in candidate_cameras(VIEWS, WIDTH, HEIGHT)]
        photographs = []
        for seed in track(range(FIRST_WRONG_SEED, FIRST_WRONG_SEED + WRONG_MESSAGES), f"messages {builder}"):
            lit = bake(PROCEDURAL[builder](seed, PLACEMENTS[PLACEMENT]), coarseness=COARSENESS - 1)
            photographs.append([read_back(photograph(lit, camera)[0]) for camera in cameras])
        save_array(file, np.array([[halved(image) for image in views] for views in photographs], np.float32))
    return np.asarray(np.load(file))


class Model(NamedTuple):
    """One trained model."""

    scheme: str
    number: int  # of its pair
    is_marked: bool

    def place(self, folder: Path) -> Path:
        """Return its folder."""
        return folder / "models" / f"{self.scheme}-{self.number}{'' if self.is_marked else '-clean'}"


def marked(scheme: str) -> list[Model]:
    """Return the marked models of a scheme."""
    return [Model(scheme, number, is_marked=True) for number in range(len(PAIRS))]


def clean(scheme: str) -> list[Model]:
    """Return clean models of a scheme's form, trained from their scene's points alone."""
    return [Model(CLEAN_OF.get(scheme, scheme), number, is_marked=False) for number in range(len(PAIRS))]


def never_held(scheme: str, message: int) -> list[Model]:
    """Return the models that never held a message: clean ones, and marked ones with another message."""
    return [*clean(scheme), *(model for model in marked(scheme) if model.number != message)]


def build(model: Model, folder: Path) -> None:
    """Train a model, unless it is stored."""
    place = model.place(folder)
    if place.is_dir():
        return
    pair = read_pair(pair_folder(folder, model.number), "both" if model.is_marked else "scene")
    settings = SCHEMES[model.scheme] | ({} if model.is_marked else {"message_weight": 0})
    public, key = hide(find_scheme(model.scheme), pair, seed=model.number, **settings)
    with filling(place) as out:
        public.write(out / "public" / "point_cloud.ply")
        if key:
            (out / "key").mkdir()
            key.write(out / "key")


def public_of(model: Model, folder: Path) -> PublicModel:
    """Return a stored model."""
    file = model.place(folder) / "public" / "point_cloud.ply"
    return find_scheme(model.scheme).read_public(file).drawn(file)


def key_of(scheme: str, message: int, folder: Path) -> Key:
    """Return the key of a marked model."""
    return find_scheme(scheme).read_key(Model(scheme, message, is_marked=True).place(folder) / "key")


def twin_of(model: Model, folder: Path, seed: int) -> PublicModel:
    """Return a redrawn twin of a marked model."""
    twin = find_scheme(model.scheme).redrawn(public_of(model, folder), np.random.default_rng(seed))
    assert twin is not None
    return twin


def suspects(scheme: str, message: int, folder: Path) -> Iterator[tuple[Path, PublicModel]]:
    """Yield the models on which the key of a message learns, each with the folder of the fitted key."""
    place = folder / "fitted" / f"{scheme}-{message}"
    for model in never_held(scheme, message):
        yield place / model.place(folder).name, public_of(model, folder)
    for seed in range(FIRST_TWIN_SEED, FIRST_TWIN_SEED + FITTED_TWINS):
        yield place / f"twin-{seed}", twin_of(Model(scheme, message, is_marked=True), folder, seed)


def fit(scheme: str, message: int, folder: Path) -> None:
    """Fit the key of a message to each of its suspects, unless the fitted key is stored."""
    photographs = pair_folder(folder, message) / "message"
    for place, public in suspects(scheme, message, folder):
        if not place.is_dir():
            key = fitted_key(key_of(scheme, message, folder), public, photographs)
            with filling(place) as out:
                key.write(out)


def make(folder: Path) -> None:
    """Make everything that claims need, unless it is stored."""
    for scheme in SCHEMES:
        for model in (*marked(scheme), *clean(scheme)):
            build(model, folder)
        report(f"models of {scheme}")
    for message in FITTED_MESSAGES:
        for scheme in LEARNING:
            fit(scheme, message, folder)
            report(f"keys of {scheme}, message {message}")
    for builder in PROCEDURAL:
        candidates_of(folder, builder)
        wrong_messages(folder, builder)
        report(f"pictures of {builder}")


class Message(NamedTuple):
    """What an owner knows of a message, and the pictures of its kind."""

    views: Sequence[Camera]  # held out
    photographs: Sequence[Float32]
    candidates: UInt8


@cache
def message_of(folder: Path, number: int) -> Message:
    """Return the message of a pair."""
    views = Capture.read(pair_folder(folder, number) / "message").dataset.test
    return Message(views, read_photographs(views), candidates_of(folder, message_kind(number).builder))


def shown(public: PublicModel, key: Key, extraction: str, views: Sequence[Camera]) -> list[Float32]:
    """Return what an extraction shows, as files of it hold it."""
    return [read_back(image) for image in key.images(public, extraction, views)]


def compared(values: Sequence[Any]) -> list[Any]:
    """Return those of the views whose traces are compared."""
    return [values[view] for view in compared_views(len(values))]


def twins_of(scheme: str, public: PublicModel) -> Iterator[PublicModel]:
    """Yield the redrawn twins with which a claim on a model is compared."""
    for seed in range(TWINS):
        twin = find_scheme(scheme).redrawn(public, np.random.default_rng(seed))
        assert twin is not None
        yield twin


class Case(NamedTuple):
    """A claim: that a model of a scheme holds a message, which a key shows."""

    scheme: str
    public: PublicModel
    key: Key
    message: Message

    def evidence(self, extraction: str = MESSAGE) -> Evidence:
        """Return the evidence of an extraction by a key that does not learn, beside redrawn twins."""
        alone = self.evidence_alone(extraction)
        truth = compared(self.message.photographs)
        views = compared(self.message.views)
        twins = [shown(twin, self.key, extraction, views) for twin in twins_of(self.scheme, self.public)]
        return replace(alone, twins=tuple(trace(images, truth) for images in twins))

    def evidence_alone(self, extraction: str = MESSAGE, *, is_fitted: bool = False) -> Evidence:
        """Return the evidence of an extraction without twins: of clean models, and of keys that learned."""
        images = shown(self.public, self.key, extraction, self.message.views)
        return evidence_of(images, self.message.photographs, self.message.candidates, is_fitted=is_fitted)


ByExtraction = Mapping[str, Evidence]


class Claim(NamedTuple):
    """A judged claim."""

    group: str
    of: str  # scheme, or kind of the message
    owner: str
    clean_models: int  # that the claim is compared with
    twins: int
    nominal: float  # rate at which wrong claims may be proven
    is_proven: bool
    is_readable: bool


def judge(group: str, of: str, suspect: ByExtraction, without: Sequence[ByExtraction] = ()) -> Iterator[Claim]:
    """Yield the claim of each owner by the evidence of a model, beside that of models without the message."""
    outcomes = [_outcome(UNATTACKED, suspect), *(_outcome(OTHER_SCENE, evidence) for evidence in without)]
    for row in judged(outcomes, {}):
        if row.variant == UNATTACKED:
            tries = len({MESSAGE, row.extraction})
            twins = max(len(evidence.twins) for evidence in suspect.values())
            nominal = tries * row.level
            yield Claim(group, of, row.owner, len(without), twins, nominal, row.is_proven, row.word == READABLE)


def _outcome(variant: str, evidence: ByExtraction) -> Outcome:
    targets = {extraction: ViewMetrics(extraction, "mean", TRUTH, {}) for extraction in evidence}
    return Outcome("claim", "claim", variant, targets, evidence=evidence)


def extractions_without_learning(scheme: str) -> list[str]:
    """Return the extractions of a scheme whose keys do not learn."""
    return [MESSAGE] if find_scheme(scheme).fits else [MESSAGE, ADAPTIVE]


def marked_claims(folder: Path) -> Iterator[Claim]:
    """Yield the claims of the owners of marked models."""
    for scheme in SCHEMES:
        names = extractions_without_learning(scheme)
        for model in marked(scheme):
            message = message_of(folder, model.number)
            key = key_of(scheme, model.number, folder)
            case = Case(scheme, public_of(model, folder), key, message)
            others = [
                Case(scheme, public_of(other, folder), key, message) for other in never_held(scheme, model.number)
            ]
            without = [{name: other.evidence_alone(name) for name in names} for other in others]
            yield from judge("marked", scheme, {name: case.evidence(name) for name in names}, without)


def wrong_message_claims(folder: Path) -> Iterator[Claim]:
    """Yield claims of other messages on marked models: beside twins, and by the candidates alone."""
    for scheme in SCHEMES:
        names = extractions_without_learning(scheme)
        for model in marked(scheme):
            views = compared(message_of(folder, model.number).views)
            key = key_of(scheme, model.number, folder)
            public = public_of(model, folder)
            images = {name: shown(public, key, name, views) for name in names}
            twins = [*twins_of(scheme, public)]
            of_twins = {name: [shown(twin, key, name, views) for twin in twins] for name in names}
            for builder in PROCEDURAL:
                of_kind = candidates_of(folder, builder)
                for suspect in wrong_evidence(images, of_twins, of_kind, wrong_messages(folder, builder)):
                    yield from judge("wrong message", builder, suspect)
                    alone = {name: replace(evidence, twins=()) for name, evidence in suspect.items()}
                    yield from judge("wrong message", builder, alone)


def wrong_evidence(
    images: Mapping[str, Sequence[Float32]],
    of_twins: Mapping[str, Sequence[Sequence[Float32]]],
    of_kind: UInt8,
    claimed: Float32,
) -> list[ByExtraction]:
    """Return the evidence of each claimed message in extractions of a model and of its twins.

    Their legibility is set to 0: it only grades proven messages, and here only the proof counts.
    """
    evidence: list[dict[str, Evidence]] = [{} for _ in claimed]
    for name, extraction in images.items():
        known = tuple(traces(extraction, of_kind).tolist())
        in_twins = np.array([traces(twin, claimed) for twin in of_twins[name]])
        for number, value in enumerate(traces(extraction, claimed).tolist()):
            evidence[number][name] = Evidence(value, 0.0, known, tuple(in_twins[:, number].tolist()))
    return [*evidence]


def fitted_claims(folder: Path) -> Iterator[Claim]:
    """Yield claims by keys that learn, on models that never held the message, and on redrawn twins of a marked one.

    They are compared with no clean model, with all others, and with each pair of a clean model and one with another
    message: such are the controls of an audit.
    """
    for scheme in LEARNING:
        for number in FITTED_MESSAGES:
            message = message_of(folder, number)
            key = key_of(scheme, number, folder)
            known: dict[str, dict[str, Evidence]] = {}
            for place, public in suspects(scheme, number, folder):
                learned = Case(scheme, public, find_scheme(scheme).read_key(place), message)
                adaptive = learned.evidence_alone(ADAPTIVE, is_fitted=True)
                known[place.name] = {MESSAGE: Case(scheme, public, key, message).evidence(), ADAPTIVE: adaptive}
            without = {name: evidence for name, evidence in known.items() if not name.startswith("twin")}
            others_marked = [model for model in marked(scheme) if model.number != number]
            controls = [{model.place(folder).name for model in pair} for pair in product(clean(scheme), others_marked)]
            for name, evidence in known.items():
                group = "fitted key" if name in without else "redrawn twin, fitted key"
                others = {*without} - {name}
                for beside in (set(), others, *(pair for pair in controls if name not in pair)):
                    yield from adaptive_only(judge(group, scheme, evidence, [without[other] for other in beside]))


def adaptive_only(claims: Iterable[Claim]) -> Iterator[Claim]:
    """Yield the claims of owners who adapt."""
    yield from (claim for claim in claims if claim.owner == ADAPTS)


def twin_claims(folder: Path) -> Iterator[Claim]:
    """Yield claims of a marked model's message on redrawn twins, by keys that do not learn."""
    for scheme in SCHEMES:
        names = extractions_without_learning(scheme)
        for model in marked(scheme):
            key = key_of(scheme, model.number, folder)
            for seed in range(FIRST_TWIN_SEED, FIRST_TWIN_SEED + CLAIMED_TWINS):
                case = Case(scheme, twin_of(model, folder, seed), key, message_of(folder, model.number))
                yield from judge("redrawn twin", scheme, {name: case.evidence(name) for name in names})


def late_key_claims(folder: Path) -> Iterator[Claim]:
    """Yield claims by keys made afterwards for strangers' clean models: without clean models, and with all others."""
    for scheme in ("splats_in_splats", *LEARNING):
        names = extractions_without_learning(scheme)
        for number in FITTED_MESSAGES:
            message = message_of(folder, number)
            for stranger in clean(scheme):
                if stranger.number == number:
                    continue
                key = late_key(scheme, stranger, number, folder)
                case = Case(scheme, public_of(stranger, folder), key, message)
                others = [other for other in never_held(scheme, number) if other != stranger]
                cases = [Case(scheme, public_of(other, folder), key, message) for other in others]
                evidence = {name: case.evidence(name) for name in names}
                yield from judge("key made afterwards", scheme, evidence)
                without = [{name: other.evidence_alone(name) for name in names} for other in cases]
                yield from judge("key made afterwards", scheme, evidence, without)


def late_key(name: str, stranger: Model, message: int, folder: Path) -> Key:
    """Return a key of a scheme that was made for a stranger's clean model, to show a message there."""
    scheme = find_scheme(name)
    if scheme.fits:
        return scheme.read_key(folder / "fitted" / f"{name}-{message}" / stranger.place(folder).name)
    place = folder / "late" / f"{name}-{message}-{stranger.number}"
    if not place.is_dir():
        key = key_with_colours(public_of(stranger, folder).model, pair_folder(folder, message) / "message", message)
        with filling(place) as out:
            key.write(out)
    return scheme.read_key(place)


def key_with_colours(model: Gaussians, photographs: Path, seed: int) -> SplatsInSplatsKey:
    """Return a key of Splats in Splats whose hidden colours learned a message on the rows of a model."""
    opacities = model.table["opacity"]
    begin = Parameters(model.means, model.quats, model.log_scales, opacities, np.zeros_like(model.sh_coeffs))
    capture = Capture.read(photographs)
    rng = np.random.default_rng(seed)
    lesson = Lesson(capture.views, capture.images, (), REFINING_STEPS, rng, device=choose_device())
    hidden = as_gaussians(refined(begin, lesson))
    return SplatsInSplatsKey(model.means, OpacityMapping.fresh(np.random.default_rng(seed)), SHIFT, hidden)


COLUMNS = (
    "group",
    "scheme or kind",
    "owner",
    "clean models",
    "twins",
    "nominal rate",
    "claims",
    "proven",
    "readable",
    "low",
    "high",
)


def table(claims: Iterable[Claim]) -> Iterator[list[Any]]:
    """Yield a row per group of claims; `low` and `high` are the interval (95 %, Clopper and Pearson) of the rate."""
    for facts, alike in grouped(claims, lambda claim: claim[:6]).items():
        proven = sum(claim.is_proven for claim in alike)
        readable = sum(claim.is_readable for claim in alike)
        low, high = binomtest(proven, len(alike)).proportion_ci(method="exact")
        yield [*facts, len(alike), proven, readable, f"{low:.4f}", f"{high:.4f}"]


def tabulate(folder: Path) -> None:
    """Judge all claims, and write the table."""
    claims: list[Claim] = []
    for judge_group in (marked_claims, wrong_message_claims, fitted_claims, twin_claims, late_key_claims):
        claims += judge_group(folder)
        report(judge_group.__name__)
    write_text(TABLE, csv_text(COLUMNS, table(claims)))


def report(stage: str) -> None:
    """Print what is done, and the time that it took."""
    print(f"{time.strftime('%H:%M:%S')} {time.process_time():7.0f} CPU s: {stage}", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "models":
        make(Path(sys.argv[2]))
    else:
        tabulate(Path(sys.argv[2]))
