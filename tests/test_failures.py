"""Statuses of failed jobs: reasons from logs, files, and the command that lists them."""

import pytest

from gspure.cli import main
from gspure.errors import InputError
from gspure.failures import (
    Failure,
    failures_below,
    is_interrupted,
    read_failure,
    reason_in,
    status_of,
    summary,
    unfinished,
)

REFUSAL = "gspure attack: attack crop: fraction: expected 0 to 1, found 7"


def failure(log="results/logs/a.log", reason=REFUSAL):
    return Failure("attack_model", reason, log, "run.log", ["results/a.npy"])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (f"reading\n{REFUSAL}\nexit status 2\n", REFUSAL),
        ("Traceback ...\nZeroDivisionError: division by zero\n\nexit status 1\n", "attack_model: ZeroDivisionError"),
        ("reading\nexit status 137\n", "attack_model: ended by SIGKILL, possibly out of memory"),
        ("reading\nexit status 139\n", "attack_model: ended by SIGSEGV"),
        ("exit status 3\n", "attack_model: exit status 3"),
        ("reading\n", "attack_model: stopped without an exit status"),
        ("", "attack_model: stopped without an exit status"),
        (None, "attack_model: stopped without an exit status"),
    ],
)
def test_the_reason_of_a_failure_is_in_its_log(tmp_path, text, reason):
    if text is not None:
        (tmp_path / "attack.log").write_text(text)
    found = reason_in(tmp_path / "attack.log", "attack_model")
    assert found.startswith(reason)
    assert "\n" not in found


@pytest.mark.parametrize(("status", "interrupted"), [(130, True), (143, True), (129, True), (137, False), (2, False)])
def test_a_job_interrupted_by_a_signal_has_not_failed(tmp_path, status, interrupted):
    (tmp_path / "attack.log").write_text(f"reading\nexit status {status}\n")
    assert is_interrupted(tmp_path / "attack.log", stopped=False) == interrupted
    assert not is_interrupted(tmp_path / "absent.log", stopped=False)
    assert is_interrupted(tmp_path / "absent.log", stopped=True)


def test_a_number_too_long_for_a_status_is_none(tmp_path):
    (tmp_path / "job.log").write_text(f"exit status {'9' * 5000}")
    assert "without an exit status" in reason_in(tmp_path / "job.log", "attack_model")


def test_a_status_lies_beside_its_log_and_is_read_back(tmp_path):
    log = str(tmp_path / "logs" / "a" / "attack.log")
    failure(log).write()
    assert status_of(log) == tmp_path / "logs" / "a" / "attack.failed.json"
    assert read_failure(status_of(log)) == failure(log)
    assert failures_below(tmp_path) == [failure(log)]


@pytest.mark.parametrize("content", ["[]", "{}", "no JSON", '{"rule": 1}'])
def test_other_json_is_not_a_status(tmp_path, content):
    (tmp_path / "a.failed.json").write_text(content)
    with pytest.raises(InputError, match=r"a\.failed\.json: file: expected"):
        failures_below(tmp_path)


def test_failures_for_the_same_reason_are_one_line():
    one, two, other = failure("a.log"), failure("b.log"), failure("c.log", "no room")
    assert summary([one, other, two]) == [f"{REFUSAL} (a.log and 1 more)", "no room (c.log)"]


def test_variants_without_metrics_are_named_by_model():
    missing = ["results/vanilla/bot/gspure/metrics.csv", "results/vanilla/bot/gspure/renders/scene"]
    missing += ["results/planted/room/crop/metrics.csv", "results/vanilla/bot/crop/metrics.csv"]
    failures = [Failure("attack_model", "no room", "a.log", "run.log", missing), failure()]
    assert unfinished(failures) == {"planted/room": ["crop"], "vanilla/bot": ["crop", "gspure"]}


def test_the_command_lists_failures_and_its_status_tells_whether_there_are_any(tmp_path, capsys):
    assert main(["failures", str(tmp_path)]) == 0
    assert capsys.readouterr().out == ""
    failure(str(tmp_path / "attack.log")).write()
    assert main(["failures", str(tmp_path)]) == 1
    assert REFUSAL in capsys.readouterr().out


def test_the_command_refuses_a_folder_that_does_not_exist(tmp_path, capsys):
    assert main(["failures", str(tmp_path / "result")]) == 2
    assert "result: folder: expected" in capsys.readouterr().err
