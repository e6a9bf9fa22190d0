"""The cost of attacks: what is counted, where it is written, and which tables show it."""

from __future__ import annotations

from pathlib import Path

import pytest

from gspure.attacks import Evidence, find_attack
from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.cost import LOG, Cost, cost_of, read_cost, spent, total
from gspure.errors import InputError
from gspure.evaluation.costs import AttackCost, attack_costs
from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.matched import match
from gspure.evaluation.results import write_results
from gspure.evaluation.survival import survival
from gspure.model import read_model, write_model
from gspure.report.tables import conditions_markdown, matched_table, survival_table
from tests.contest_cases import benchmark
from tests.models import blobs, camera, tilted_camera

SWEEPS = {"pruning": ["weak", "strong"]}
OUTCOMES = benchmark({"room": {"weak": (0.1, 2.0), "strong": (3.0, 9.0), "gspure": (0.5, 5.0)}}, seeds=2)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    write_model(tmp_path / "model.ply", blobs(3000))
    write_cameras(tmp_path / "cameras.json", [camera(name="a"), tilted_camera(name="b")])
    return tmp_path / "model.ply"


def attack(model: Path, *words: object) -> Cost | None:
    cost = model.with_name("attack.cost.json")
    words = ("attack", "gaussian_noise", "--model", model, "--out", model.with_name("out.ply"), "--cost", cost, *words)
    assert main([*map(str, words)]) == 0
    return read_cost(cost) if cost.exists() else None


def test_costs_add_up_and_the_memory_is_that_of_the_largest_job() -> None:
    assert total([Cost(1.0, 300.0), Cost(2.5, 200.0)]) == Cost(3.5, 300.0)


def test_an_attack_counts_its_measurements_and_changes_no_byte_of_the_model(model: Path) -> None:
    alone = attack(model)
    content = model.with_name("out.ply").read_bytes()
    weights, tree = (model.with_name(f"{name}.cost.json") for name in ("weights", "tree"))
    Cost(5000.0, 1.0).write(weights)
    Cost(500.0, 9e6).write(tree)
    with_measurements = attack(model, "--measured", weights, tree)
    assert 0 < alone.cpu <= with_measurements.cpu - 5500 < alone.cpu + 60
    assert with_measurements.memory == 9e6 > alone.memory > 10
    assert model.with_name("out.ply").read_bytes() == content


def test_an_attack_with_a_measurement_of_unknown_cost_has_none(model: Path) -> None:
    assert attack(model, "--measured", model.with_name("weights.cost.json")) is None


def test_the_search_for_a_strength_does_not_count(model: Path) -> None:
    before = spent().cpu
    cost = attack(model, "--damage", "1.234", "--cameras", model.with_name("cameras.json"), "--split", "all")
    assert cost.cpu - before < 0.5 * (spent().cpu - before)


def test_a_job_writes_its_cost_beside_its_log(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOG, str(model.with_name("job.log")))
    assert main(["info", str(model.with_name("nothing.ply"))]) == 2
    assert not cost_of(model.with_name("job.log")).exists()
    assert main(["info", str(model)]) == 0
    assert read_cost(model.with_name("job.cost.json")).cpu > 0


def test_another_file_is_no_cost(tmp_path: Path) -> None:
    (tmp_path / "attack.cost.json").write_text('{"cpu": "much"}')
    with pytest.raises(InputError, match=r"attack\.cost\.json: "):
        read_cost(tmp_path / "attack.cost.json")


def written(folder: Path) -> Path:
    for asset, factor in {"room": 1.0, "room@1": 3.0}.items():
        for variant, cpu in {"weak": 1.0, "strong": 5.0, "gspure": 20.0}.items():
            path = folder / "sis" / asset / variant / "attack.cost.json"
            path.parent.mkdir(parents=True)
            Cost(factor * cpu, 100.0).write(path)
    return folder


def test_costs_are_means_over_scenes_and_seeds_and_over_the_variants_of_a_sweep(tmp_path: Path) -> None:
    costs = {row.attack: row.cpu for row in attack_costs(OUTCOMES, SWEEPS, written(tmp_path))}
    assert costs == {"weak": 2.0, "strong": 10.0, "gspure": 40.0, "pruning": 6.0}


def test_contest_writes_costs_and_shows_them_beside_the_drops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_results(tmp_path / "results.csv", OUTCOMES)
    names = ("out", "survival", "matched", "benchmarks/costs")
    words = ["contest", "--table", "results.csv", "--sweep", "pruning=weak,strong", "--markdown", "contest.md"]
    words += [word for name in names for word in (f"--{Path(name).name}", f"{name}.csv")]
    words += ["--benchmarks", str(written(tmp_path / "benchmarks"))]
    words = [str(tmp_path / word) if "." in word else word for word in words]
    with monkeypatch.context() as patch:
        patch.setattr("gspure.artifacts.write_record", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            main(words)
    for _ in range(2):  # costs may be in the folder that they are from, also those of a killed run
        assert main(words) == 0
    costs = read_table(tmp_path / "benchmarks" / "costs.csv", AttackCost)
    assert costs == attack_costs(OUTCOMES, SWEEPS, tmp_path / "benchmarks")
    rows = (survival(OUTCOMES), (), match(OUTCOMES, SWEEPS))
    assert conditions_markdown(*rows, costs).count("CPU time [s]") == 2
    assert "CPU time" not in conditions_markdown(*rows)
    assert (tmp_path / "contest.md").read_text().count("CPU time [s]") == 2


def test_tables_show_the_cost_of_attacks_and_sweeps(tmp_path: Path) -> None:
    cost = {row.attack: row for row in attack_costs(OUTCOMES, SWEEPS, written(tmp_path))}
    for table, attacks in (
        (survival_table(survival(OUTCOMES), cost), {"gspure": "40", "weak": "2.0"}),
        (matched_table(match(OUTCOMES, SWEEPS), cost), {"gspure": "40", "pruning": "6.0"}),
    ):
        assert "peak memory includes it" in table.note
        column = [c.title for c in table.columns].index("CPU time [s]")
        shown = {str(row.cells[0]): str(row.cells[column]) for row in table.rows}
        assert {"gspure" if name == "GSPure" else name: s for name, s in shown.items() if s != "–"}.items() >= (
            attacks.items()
        )


def test_a_sweep_and_its_variant_of_the_same_name_have_costs_of_their_own(tmp_path: Path) -> None:
    sweeps = {"weak": ["weak", "strong"]}
    costs = attack_costs(OUTCOMES, sweeps, written(tmp_path))
    assert [(row.kind, row.cpu) for row in costs if row.attack == "weak"] == [("variant", 2.0), ("sweep", 6.0)]
    markdown = conditions_markdown(survival(OUTCOMES), (), match(OUTCOMES, sweeps), costs)
    for table, cpu in zip(markdown.split("Drop of the message at"), ("2.0", "6.0"), strict=True):
        (row,) = (line for line in table.splitlines() if line.startswith("| weak "))
        assert f" {cpu} " in row


def test_the_result_of_an_attack_does_not_hold_its_cost(model: Path) -> None:
    attack(model)
    expected = find_attack("gaussian_noise").apply(read_model(model), Evidence()).model
    assert read_model(model.with_name("out.ply")).comments == expected.comments
