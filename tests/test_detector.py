"""Commands of detectors: what they get, what they may answer, and how they fail."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gspure.artifacts import file_digest, read_json, write_record
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation import detector
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.detection import Reading
from gspure.evaluation.detector import files_of, read_bits, read_marks
from gspure.images import record_views, write_image


def printing(text: str) -> str:
    """The command of a detector that prints `text`; the folder of images is ignored."""
    return shlex.join([sys.executable, "-c", f"print({text!r})"])


@pytest.fixture
def renders(tmp_path):
    folder = tmp_path / "renders"
    for view in ("a", "b"):
        write_image(folder / f"{view}.png", np.zeros((4, 4, 3)))
    return folder


def test_a_detector_gets_the_folder_and_its_last_line_counts(renders):
    code = 'import pathlib, sys; print(\'loading\'); print(\'{"a": "0110", "b": "1111"}\'.replace(\'a\', sorted('
    code += "pathlib.Path(sys.argv[1]).glob('*.png'))[0].stem))"
    readings = read_marks(shlex.join([sys.executable, "-c", code]), renders, "0111", 60)
    assert readings == [Reading("a", 75.0, 4), Reading("b", 75.0, 4)]
    assert read_marks(printing('{"b": 2, "a": -0.5}'), renders, "", 60) == [Reading("a", -0.5, 0), Reading("b", 2.0, 0)]


@pytest.mark.parametrize(
    ("answer", "message", "reason"),
    [
        ("no JSON", "", "expected a JSON object in the last line, found no JSON"),
        ("", "", "found nothing"),
        ("[1, 2]", "", "expected a JSON object"),
        ("[" * 100_000, "", "expected a JSON object"),
        ('{"a": 1, "a": 2, "b": 1}', "", "expected a JSON object"),
        ('{"a": 1}', "", "b: expected an entry for every image, found no entry"),
        ('{"a": 1, "b": 1, "c": 1}', "", "c: expected an entry for every image, found an entry without an image"),
        ('{"a": true, "b": 1}', "", "a: expected a score"),
        ('{"a": NaN, "b": 1}', "", "a: expected a score"),
        ('{"a": 1e999, "b": 1}', "", "a: expected a score"),
        ('{"a": 1e200, "b": 1}', "", "a: expected a score"),
        (f'{{"a": 1{"0" * 400}, "b": 1}}', "", "a: expected a score"),
        ('{"a": "01", "b": "01"}', "", "set `message` to the embedded bits"),
        ('{"a": "01", "b": "011"}', "01", "b: expected 2 bits"),
        ('{"a": "01", "b": "0x"}', "01", "b: expected 2 bits"),
        ('{"a": "01", "b": 1}', "01", "b: expected 2 bits"),
    ],
)
def test_any_other_answer_is_refused_in_one_line(renders, answer, message, reason):
    with pytest.raises(InputError) as refusal:
        read_marks(printing(answer), renders, message, 60)
    assert reason in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("no-such-program", "No such file"),
        ("'", "No closing quotation"),
        (shlex.join([sys.executable, "-c", "raise SystemExit('weights are missing')"]), "found weights are missing"),
        (shlex.join([sys.executable, "-c", "raise SystemExit(3)"]), "found exit status 3"),
        (shlex.join([sys.executable, "-c", "import time; time.sleep(60)"]), "expected an answer within 0.5 s"),
    ],
)
def test_a_command_that_cannot_answer_is_refused(renders, command, reason):
    with pytest.raises(InputError, match=reason):
        read_marks(command, renders, "", 0.5 if "sleep" in command else 60)


def test_only_the_last_line_of_a_detector_is_held(renders, monkeypatch):
    monkeypatch.setattr(detector, "LONGEST_LINE", 1 << 20)
    answer = '{"a": 1, "b": 2}'
    code = f"print(('x' * 99 + chr(10)) * 50_000); print({answer!r})"
    assert len(read_marks(shlex.join([sys.executable, "-c", code]), renders, "", 60)) == 2
    endless = "while True: print('x' * 4096, end='')"
    with pytest.raises(InputError, match="a last line of at most 1 MiB"):
        read_marks(shlex.join([sys.executable, "-c", endless]), renders, "", 60)


def test_a_detector_that_takes_too_long_ends_with_all_that_it_started(renders, tmp_path):
    started = tmp_path / "pid"
    with pytest.raises(InputError, match="expected an answer within 2 s"):
        read_marks(shlex.join(["sh", "-c", f"sleep 60 & echo $! > {started}; wait"]), renders, "", 2)
    status = Path(f"/proc/{started.read_text().strip()}/stat")
    until = time.monotonic() + 10
    while status.exists() and status.read_text().split()[2] != "Z":
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.mark.parametrize("change", ["rm $0/a.png", "cp $0/b.png $0/a.png"])
def test_a_detector_that_changes_an_image_is_refused(renders, change):
    write_image(renders / "b.png", np.ones((4, 4, 3)))
    with pytest.raises(InputError, match=r"a\.png: content: expected the image as before"):
        read_marks(shlex.join(["sh", "-c", f'{change}; echo \'{{"a": 1, "b": 1}}\'']), renders, "", 60)


@pytest.mark.parametrize("name", ["b.jpg", "b.PNG"])
def test_images_that_would_not_count_are_refused(renders, name):
    (renders / "b.png").rename(renders / name)
    with pytest.raises(InputError, match="expected only PNG files"):
        read_marks(printing('{"a": 1}'), renders, "", 60)
    with pytest.raises(InputError, match="expected only PNG files"):
        read_bits(lambda _: np.ones(4, np.bool_), np.ones(4, np.bool_), renders)


@pytest.mark.parametrize(
    ("read", "found"),
    [
        (np.ones((4, 1), np.bool_), r"bool \[4, 1\]"),
        (np.ones(3, np.bool_), r"bool \[3\]"),
        (np.array(1), r"int64 \[\]"),
        (np.array([1, -1, 1, 1]), r"int64 \[4\]"),
        (np.full(4, 0.9), r"float64 \[4\]"),
        (np.full(4, 255, np.uint8), r"uint8 \[4\]"),
        ("1111", "str"),
        (None, "NoneType"),
        ([True] * 4, "list"),
    ],
)
def test_a_key_that_reads_no_bits_is_refused(renders, read, found):
    with pytest.raises(InputError, match=f"key: bits read from an image: expected an array of 4 bits.* found {found}"):
        read_bits(lambda _: read, np.ones(4, np.bool_), renders)


def test_bits_may_be_whole_numbers(renders):
    readings = read_bits(lambda _: np.array([1, 0, 1, 1], np.uint8), np.ones(4, np.bool_), renders)
    assert {reading.value for reading in readings} == {3}


def test_a_folder_without_images_is_refused(tmp_path):
    with pytest.raises(InputError, match="PNG files"):
        read_marks(printing("{}"), tmp_path, "", 60)


def test_the_files_of_a_command_are_words_or_values_of_options(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("detect.py", "my weights.pt", "a=b", "folder/x"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).touch()
    command = "python detect.py --weights='my weights.pt' --mode=fast -k folder a=b --empty="
    assert files_of(command) == ["detect.py", "my weights.pt", "a=b"]


def test_the_command_writes_readings_and_their_mean(renders, tmp_path, capsys):
    out = tmp_path / "bits.csv"
    words = ["detect", str(renders), "--command", printing('{"a": "0110", "b": "1111"}'), "--out", str(out)]
    assert main([*words, "--message", "0111"]) == 0
    assert read_table(out, Reading) == [Reading("a", 75.0, 4), Reading("b", 75.0, 4)]
    settings, program = read_json(tmp_path / "bits.csv.json")["settings"], Path(sys.executable)
    assert (settings["message"], settings[f"file {program}"]) == ("0111", file_digest(program))
    assert "75 % of the bits are correct" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main([*words, "--message", "01a"])


def test_the_command_reads_bits_with_a_key(renders, tmp_path, monkeypatch):
    (tmp_path / "key").mkdir()
    key = SimpleNamespace(bits=np.array([False, True]), read_bits=lambda image: np.array([True, True]))
    monkeypatch.setattr("gspure.schemes.registry.find_scheme", lambda name: SimpleNamespace(read_key=lambda path: key))
    words = ["detect", str(renders), "--scheme", "bits", "--key", str(tmp_path / "key")]
    assert main([*words, "--out", str(tmp_path / "bits.csv")]) == 0
    assert read_table(tmp_path / "bits.csv", Reading) == [Reading("a", 50.0, 2), Reading("b", 50.0, 2)]
    assert read_json(tmp_path / "bits.csv.json")["settings"] == {"scheme": "bits"}


@pytest.mark.parametrize(("option", "recorded"), [(["--control"], "run 1"), (["--wrong-key", "5"], "wrong_key")])
def test_readings_name_the_key(renders, tmp_path, monkeypatch, option, recorded):
    (tmp_path / "key").mkdir()
    (tmp_path / "key" / "bits").write_text("01")
    write_record(tmp_path / "key" / "bits", inputs={}, settings={}, embedding="run 1")
    bits = {"bits": np.array([False, True]), "read_bits": lambda image: np.array([True, True]), "write": lambda _: None}
    key = SimpleNamespace(wrong=lambda _: SimpleNamespace(**bits), **bits)
    monkeypatch.setattr("gspure.schemes.registry.find_scheme", lambda name: SimpleNamespace(read_key=lambda path: key))
    words = ["detect", str(renders), "--scheme", "bits", "--key", str(tmp_path / "key"), *option]
    assert main([*words, "--out", str(tmp_path / "bits.csv")]) == 0
    assert read_json(tmp_path / "bits.csv.json")["settings"]["key"] == recorded


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["--command", "true", "--wrong-key", "0"], "--wrong-key"),
        (["--command", "true", "--scheme", "planted"], "--scheme"),
        (["--key", "key", "--scheme", "planted", "--message", "01"], "--message"),
    ],
)
def test_options_of_another_source_of_readings_are_refused(renders, tmp_path, words, option, capsys):
    (tmp_path / "key").mkdir()
    words = [str(tmp_path / word) if word == "key" else word for word in words]
    assert main(["detect", str(renders), *words, "--out", str(tmp_path / "out.csv")]) == 2
    assert f"detect: {option}: expected none" in capsys.readouterr().err


def test_the_record_of_readings_names_the_files_that_the_detector_only_reads(renders, tmp_path):
    script, log, out = tmp_path / "detect.py", tmp_path / "log.txt", tmp_path / "scores.csv"
    script.write_text("import sys; open(sys.argv[1], 'a').write('.'); print('{\"a\": 1, \"b\": 2}')")
    log.touch()
    command = shlex.join([sys.executable, str(script), str(log)])
    assert main(["detect", str(renders), "--command", command, "--out", str(out)]) == 0
    settings = read_json(Path(f"{out}.json"))["settings"]
    assert settings[f"file {script}"] == file_digest(script)
    assert f"file {log}" not in settings


def test_images_of_another_target_than_the_scene_are_refused(renders, tmp_path, capsys):
    words = ["detect", str(renders), "--command", printing('{"a": 1, "b": 2}'), "--out", str(tmp_path / "marks.csv")]
    for target, status in (("scene", 0), ("message", 2)):
        record_views(renders, {"a": [], "b": []}, target=target)
        assert main(words) == status
    assert "target: expected scene, found message" in capsys.readouterr().err
