"""Evidence of a message: its trace, its legibility, its bits; and how often wrong claims pass."""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from gspure.metrics.bit_evidence import bit_evidence
from gspure.metrics.legibility import READABLE, TRACES, legibility
from gspure.metrics.proof import Traces, models_p, prove, rank_p, trace, traces
from gspure.metrics.readings import Reading
from gspure.scenes.candidates import Kind, candidate_cameras, candidates, kind_of

Array = NDArray[np.float64]
NONE = np.empty(0)
SCENES = 30


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.uint8]:
    """Random rooms in two views at half size."""
    cameras = candidate_cameras(16, 80, 60)
    return candidates(Kind("interior", "raised"), cameras, SCENES)


def full_size(half: NDArray[np.uint8]) -> Array:
    return np.kron(half, np.ones((1, 2, 2, 1))) / 255


@pytest.fixture(scope="module")
def message(pictures: NDArray[np.uint8]) -> Array:
    return full_size(pictures[0])


def noisy(picture: Array, share: float, seed: int = 0) -> Array:
    return share * picture + (1 - share) * np.random.default_rng(seed).random(picture.shape)


CHANGES: dict[str, tuple[Callable[[Array], Array], float, float]] = {  # trace and legibility of the changed message
    "itself": (lambda m: m, 1.0, 1.0),
    "faded": (lambda m: 0.8 + 0.1 * m, 1.0, 1.0),
    "inverted": (lambda m: 1 - m, -1.0, 1.0),
    "blank": (lambda m: np.full_like(m, 0.3) + 1e-4 * m, 0.0, 0.0),
    "half black": (lambda m: m * [[[[1]] * 40 + [[0]] * 40]], 0.6, 0.5),
    "mirrored": (lambda m: m[:, :, ::-1], 0.1, 0.1),
    "noise": (lambda m: noisy(m, 0.0), 0.0, 0.0),
}


@pytest.mark.parametrize(("change", "level", "readable"), CHANGES.values(), ids=CHANGES.keys())
def test_trace_and_legibility_say_what_is_left(
    change: Callable[[Array], Array], level: float, readable: float, message: Array
) -> None:
    extraction = change(message)
    exact = {-1.0, 0.0, 1.0}
    assert trace(extraction, message) == pytest.approx(level, abs=0.01 if level in exact else 0.15)
    assert legibility(extraction, message) == pytest.approx(readable, abs=0.05 if readable in exact else 0.15)


def test_wrong_messages_are_not_legible(pictures: NDArray[np.uint8], message: Array) -> None:
    scores = [legibility(full_size(room), message) for room in pictures]
    assert scores[0] >= READABLE > TRACES > max(scores[1:])
    assert legibility(message, np.zeros_like(message)) == 0  # nothing to read
    corner = np.zeros_like(message)
    corner[:, :20, :30] = message[:, :20, :30]
    assert legibility(corner, corner) == 1


def test_a_readable_message_is_one_that_two_viewers_can_read() -> None:
    table = Path(__file__).parents[1] / "experiments" / "tables" / "legibility.csv"
    with table.open(newline="") as file:
        rows = [*csv.DictReader(file)]
    for viewer in ("viewer_1", "viewer_2"):
        alike = [(float(row["legibility"]) >= READABLE) == (row[viewer] == "readable") for row in rows]
        assert (sum(alike), len(alike)) == (35, 40)


def test_traces_are_those_of_a_loop(pictures: NDArray[np.uint8], message: Array) -> None:
    extraction = noisy(message, 0.2)
    loop = [trace(extraction, full_size(room)) for room in pictures]
    assert traces(extraction, pictures) == pytest.approx(loop, abs=1e-6)


def test_the_trace_is_the_correlation_of_gradients_at_half_size() -> None:
    a, b = np.random.default_rng(0).random((2, 4, 5, 3))
    first, second = (np.concatenate([np.diff(image, axis=axis).ravel() for axis in (0, 1)]) for image in (a, b))
    expected = first @ second / np.sqrt((first @ first) * (second @ second))
    doubled = [np.kron(image, np.ones((2, 2, 1)))[None] for image in (a, b)]
    assert trace(*doubled) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.3])
def test_a_wrong_message_of_the_same_kind_passes_at_most_at_the_nominal_rate(
    share: float, pictures: NDArray[np.uint8], message: Array
) -> None:
    values = traces(noisy(message, share), pictures)
    ranks = [rank_p(values[i], np.delete(values, [0, i])) for i in range(1, SCENES)]
    for rate in (0.05, 0.1, 0.2, 0.5):
        assert np.mean([p <= rate for p in ranks]) <= rate
    assert (rank_p(values[0], values[1:]) == 1 / SCENES) == (share > 0)


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("ratio", [1.0, 5.0])  # spread of models, divided by that of candidates
@pytest.mark.parametrize("K", [2, 3, 8])
def test_a_model_without_the_message_passes_at_most_at_the_nominal_rate(
    K: int, ratio: float, *, two_sided: bool
) -> None:
    rng = np.random.default_rng(K)
    draws = 0.2 + 0.03 * ratio * rng.normal(size=(4000, K + 1))
    passed = [(models_p(float(row[0]), row[1:], 0.03, two_sided=two_sided) or 0.0) <= 0.05 for row in draws]
    assert np.mean(passed) <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / len(draws))


def test_few_models_prove_little_and_one_is_no_control() -> None:
    models = np.array([0.02, -0.01, 0.03, 0.0, 0.01, -0.02, 0.04, 0.0])
    assert models_p(0.9, models[:1], 0.03) is None
    assert models_p(0.9, np.zeros(8), 0.0) is None
    by_count = [models_p(0.9, models[:K], 0.03) for K in (2, 3, 8)]
    assert [p is not None and p <= 0.001 for p in by_count] == [False, True, True]
    assert models_p(0.5, models[:3], 0.03) == pytest.approx(0.0024, abs=2e-4)
    assert models_p(-0.5, models, 0.03) == pytest.approx(1.0)
    assert models_p(-0.5, models, 0.03, two_sided=True) < 1e-5


def attempt(
    level: float, *, clean: float = 0.0, twins: float = 0.0, count: int = 999, two_sided: bool = False
) -> Traces:
    """A try with normal candidates, and eight models of each kind around a level."""
    rng = np.random.default_rng(count)
    clean_traces = clean + 0.02 * rng.normal(size=8)
    return Traces(level, 0.03 * rng.normal(size=count), clean_traces, twins + 0.02 * rng.normal(size=8), two_sided)


PROOFS = {
    "present": (attempt(0.4), True),
    "shown in clean models too: a fitted key": (attempt(0.4, clean=0.4), False),
    "shown in twins too: key-only": (attempt(0.98, twins=0.98), False),
    "absent": (attempt(0.03), False),
    "inverted": (attempt(-0.4), False),
    "inverted, not fitted": (attempt(-0.4, two_sided=True), True),
    "without models": (attempt(0.4)._replace(clean=NONE, twins=NONE), True),
    "few candidates, at their level": (attempt(0.4, count=60), True),
    "too few candidates": (attempt(0.4, count=10), False),
    "no kind": (attempt(0.4, count=0), False),
}


@pytest.mark.parametrize(("traces_of", "proven"), PROOFS.values(), ids=PROOFS.keys())
def test_a_message_is_proven_against_everything_without_it(traces_of: Traces, *, proven: bool) -> None:
    proof = prove(traces_of)
    count = len(traces_of.candidates)
    assert proof.is_proven is proven
    assert proof.level == max(0.001, 1 / (count + 1))
    assert proof.p >= proof.p_candidates >= 1 / (count + 1)
    assert (proof.candidates, proof.clean_models, proof.twins) == (count, len(traces_of.clean), len(traces_of.twins))


def test_a_blank_extraction_has_p_1(pictures: NDArray[np.uint8], message: Array) -> None:
    blank = np.full_like(message, 0.3)
    proof = prove(Traces(trace(blank, message), traces(blank, pictures), np.full(8, -0.5), NONE))
    assert (proof.trace, proof.p, proof.p_twins) == (0.0, 1.0, None)
    assert math.isnan(proof.z)


@pytest.mark.parametrize(
    ("decoded", "message", "correct"),
    [
        (["1011"], "1011", 4),
        (["1011", "1011", "0000"], "1011", 4),
        (["1011", "0000"], "1011", 1),  # ties count as wrong
        (["0100"] * 3, "1011", 0),
        (["10" * 64], "10" * 60 + "01" * 4, 120),
    ],
)
def test_bits_are_those_of_the_majority(decoded: list[str], message: str, correct: int) -> None:
    evidence = bit_evidence([Reading("view", 0.0, len(message), bits) for bits in decoded], message)
    n = len(message)
    assert evidence[1:] == (correct, n, len(decoded))
    assert evidence.p == pytest.approx(binom.sf(correct - 1, n, 0.5), rel=1e-9)
    assert evidence.p >= 2.0**-n


def test_candidates_are_scenes_of_the_kind_of_the_message_in_held_out_views() -> None:
    kinds = {name: kind_of(name, "front") for name in ("vault", "interior-3", "object-7", "photos/garden")}
    assert [kind and kind.builder for kind in kinds.values()] == ["interior", "interior", "object", None]
    cameras = candidate_cameras(32, 48, 36)
    assert [camera.name for camera in cameras] == ["view_000", "view_008", "view_016", "view_024"]
    pictures = candidates(Kind("object", "raised"), cameras[:2], 2)
    assert pictures.shape == (2, 2, 18, 24, 3)
    assert not np.array_equal(pictures[0], pictures[1])
