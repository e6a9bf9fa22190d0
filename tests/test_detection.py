"""Detection: thresholds, commands of detectors, and what they may answer."""

import math
import shlex
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from gspure.errors import InputError
from gspure.images import write_image
from gspure.metrics.detection import Threshold, detection
from gspure.metrics.readings import Reading, read_marks
from gspure.schemes.readability import model_bit_readability


@pytest.mark.parametrize("rate", [0.01, 0.001])
@pytest.mark.parametrize("bits", [10, 16, 32, 48])
def test_the_threshold_of_bits_is_the_lowest_that_keeps_the_rate(bits, rate):
    threshold = Threshold.at_rate(rate, bits)
    assert threshold.rate == pytest.approx(binom.sf(threshold.value, bits, 0.5))
    assert threshold.rate <= rate
    assert binom.sf(threshold.value - 1, bits, 0.5) > rate


@pytest.mark.parametrize(
    ("bits", "correct", "wrong", "readable"),
    [
        (16, 14, 8, True),
        (16, 13, 8, False),  # as many as chance explains
        (16, 14, 14, False),  # as many as with a wrong key
        (6, 6, 3, False),  # chance explains any number
        *((bits, int(Threshold.at_rate(0.01, bits).value), 0, False) for bits in (24, 30, 48, 56, 96, 131)),
    ],
)
def test_embedded_bits_are_readable_only_above_chance_and_wrong_key(bits, correct, wrong, readable):
    def reader(right):
        readings = [Reading("model", 100 * right / bits, bits, "")]
        return SimpleNamespace(bits=np.ones(bits, bool), model_readings=lambda _: readings)

    key = reader(correct)
    key.wrong = lambda _: reader(wrong)
    assert model_bit_readability(None, key).readable == readable


def test_the_threshold_of_scores_is_that_of_clean_views_and_the_rate_of_few_is_not_claimed():
    clean = np.random.default_rng(0).normal(size=2000).tolist()
    readings = [Reading(view, score, 0, "") for view, score in {"a": 3.5, "b": 2.5, "c": 0.0}.items()]
    many = detection(readings, clean)
    few = detection(readings, clean[:20])
    assert (many.tpr, many.tpr_strict) == (pytest.approx(2 / 3), pytest.approx(1 / 3))
    assert math.isnan(few.tpr)
    assert math.isnan(few.tpr_strict)
    assert few.p == pytest.approx(3 / 253)  # two of three views exceed all 20: C(22, 2) of them all draws C(23, 3)
    assert detection(readings, []).least_p == 1


@pytest.mark.parametrize("hits", [0, 1, 4])
def test_the_p_of_a_mark_is_that_of_as_many_views_above_the_threshold(hits):
    read = detection([Reading(str(i), 100.0 if i < hits else 50.0, 32, "") for i in range(4)], [])
    rate = Threshold.at_rate(0.01, 32).rate
    assert (read.tpr, read.level) == (hits / 4, 50 + 12.5 * hits)
    assert read.p == pytest.approx(binom.sf(hits - 1, 4, rate))
    assert read.least_p == pytest.approx(rate**4)


def printing(text: str) -> str:
    """The command of a detector that prints `text`; the folder of images is ignored."""
    return shlex.join([sys.executable, "-c", f"print({text!r})"])


@pytest.fixture
def renders(tmp_path):
    folder = tmp_path / "renders"
    for view in ("a", "b"):
        write_image(folder / f"{view}.png", np.zeros((4, 4, 3)))
    return folder


def test_a_detector_gets_a_folder_that_it_may_change_and_its_last_line_counts(renders):
    before = {file.name: file.read_bytes() for file in renders.iterdir()}
    code = "import pathlib, sys; [file.write_bytes(b'') for file in pathlib.Path(sys.argv[1]).glob('*.png')]; "
    code += """print('loading'); print('{"a": "0110", "b": "1111"}')"""
    readings = read_marks(shlex.join([sys.executable, "-c", code]), renders, "0111", 60)
    assert readings == [Reading("a", 75.0, 4, "0110"), Reading("b", 75.0, 4, "1111")]
    assert {file.name: file.read_bytes() for file in renders.iterdir()} == before
    scores = read_marks(printing('{"b": 2, "a": -0.5}'), renders, "", 60)
    assert scores == [Reading("a", -0.5, 0, ""), Reading("b", 2.0, 0, "")]


@pytest.mark.parametrize(
    ("answer", "message", "reason"),
    [
        ("no JSON", "", "expected a JSON object in the last line, found no JSON"),
        ("[" * 100_000, "", "expected a JSON object"),
        ('{"a": 1}', "", "b: expected an entry for every image, found no entry"),
        ('{"a": 1, "b": 1, "c": 1}', "", "c: expected an entry for every image, found a further entry"),
        ('{"a": NaN, "b": 1}', "", "a: expected a score"),
        ('{"a": "01", "b": "01"}', "", "set `message` to the embedded bits"),
        ('{"a": "01", "b": "011"}', "01", "b: expected 2 bits"),
    ],
)
def test_any_other_answer_is_refused_in_one_line(renders, answer, message, reason):
    with pytest.raises(InputError) as refusal:
        read_marks(printing(answer), renders, message, 60)
    assert reason in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


def test_a_detector_gets_a_models_file_and_answers_with_one_entry(tmp_path):
    file = tmp_path / "model.ply"
    file.touch()
    assert read_marks(printing('{"model": "0110"}'), file, "0111", 60) == [Reading("model", 75.0, 4, "0110")]
    with pytest.raises(InputError, match='a: expected one entry, "model", found a further entry'):
        read_marks(printing('{"a": "0110"}'), file, "0111", 60)


def test_a_detector_that_takes_too_long_ends_with_all_that_it_started(renders, tmp_path):
    started = tmp_path / "pid"
    with pytest.raises(InputError, match="expected an answer within 2 s"):
        read_marks(shlex.join(["sh", "-c", f"sleep 60 & echo $! > {started}; wait"]), renders, "", 2)
    status = Path(f"/proc/{started.read_text().strip()}/stat")
    until = time.monotonic() + 10
    while status.exists() and status.read_text().split()[2] != "Z":
        assert time.monotonic() < until
        time.sleep(0.05)
