"""What attacks that no image shows do to messages, from the results of ``gspure audit experiments/free_attacks.yaml``.

``python -m experiments.free_attacks RESULTS...`` writes tables/free_attacks.csv: for each model and attack the largest
change of a pixel in the held-out views, the number of pixels that change by more than `INVISIBLE`, the damage, dB, and
what an owner reads, as published and after adapting. z compares the trace with candidates alone; the word counts clean
models, too. For `gauge`, also the least and the largest trace as published over several seeds. Rows of other scenes
stay in the table.
"""

import csv
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gspure.arrays import Float32
from gspure.attacks import find_attack
from gspure.cameras.splits import read_split
from gspure.constants import Energy
from gspure.evaluation.collecting import collect
from gspure.evaluation.judging import judged, proof_of
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.plan import Job, read_plan
from gspure.evaluation.results import Result
from gspure.files import write_text
from gspure.images import read_back
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.names import GSPURE
from gspure.metrics.proof import trace
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.training.dataset import read_photographs

TABLE = Path(__file__).resolve().parent / "tables" / "free_attacks.csv"
GAUGE = "gauge"
INVISIBLE = 2e-6
ENERGIES: tuple[Energy, ...] = ("ewa", "ray")
READING = ("psnr", "legible", "trace", "z", "word")
SEEDS = 16
COLUMNS = ("scheme", "scene", "attack", "largest_change", "largest_change_ray", "changed_pixels", "pixels", "damage")
OWNERS = {"published": MESSAGE, "adaptive": ADAPTIVE}


def largest_changes(job: Job) -> tuple[float, float, int, int]:
    """Return the largest change of a pixel by energy, the number of changed pixels with ``ewa``, and of all pixels."""
    scheme = job.owner.scheme if job.owner else None
    before = read_public_model(job.public, scheme)
    after = read_public_model(job.folder / "public", scheme)
    views = read_split(job.views.cameras, job.views.split)

    def changes(energy: Energy) -> Float32:
        scenes = [public.scene(None, before.model.background, energy) for public in (before, after)]
        differences = [np.abs(scenes[0](view) - scenes[1](view)).max(axis=2) for view in views]
        return np.concatenate([difference.ravel() for difference in differences])

    ewa, ray = map(changes, ENERGIES)
    return float(ewa.max()), float(ray.max()), int((ewa > INVISIBLE).sum()), ewa.size


def traces_by_seed(job: Job) -> list[float]:
    """Return the trace of the message as published after `gauge` with several seeds."""
    if job.owner is None:
        return []
    scheme = find_scheme(job.owner.scheme)
    public = scheme.read_public(job.public)
    key = scheme.read_key(job.owner.key)
    views = read_split(job.owner.message_cameras, job.views.split)
    photographs = read_photographs(views)
    traces = []
    for seed in range(SEEDS):
        attacked = find_attack(GAUGE).apply(public, seed=seed).published(public)
        shown = [read_back(image) for image in key.images(attacked, MESSAGE, views)]
        traces.append(trace(shown, photographs))
    return traces


def reading(outcome: Outcome, row: Result) -> Iterator[str]:
    """Yield the cells of `READING`."""
    evidence = outcome.evidence[row.extraction]
    yield f"{row.message_values['psnr']:.1f}"
    yield f"{100 * evidence.legibility:.0f}"
    yield f"{evidence.trace:.2f}"
    yield f"{proof_of(evidence, ()).z:.1f}"
    yield row.word


def table(results: Path) -> Iterator[Sequence[str]]:
    """Yield the rows of the table."""
    plan = read_plan(results)
    outcomes = collect(results, plan.models)
    rows = {(row.model, row.variant, row.extraction): row for row in judged(outcomes, plan.attacks)}
    jobs = {(model.id, job.variant): job for model in plan.models for job in model.jobs}
    for outcome in outcomes:
        if outcome.is_control or outcome.failure or outcome.variant == GSPURE:
            continue
        job = jobs[outcome.model, outcome.variant]
        ewa, ray, changed, pixels = largest_changes(job)
        cells = [outcome.scheme, outcome.scene, outcome.variant, f"{ewa:.1e}", f"{ray:.1e}", f"{changed}", f"{pixels}"]
        cells.append(f"{round(outcome.damage, 3) + 0.0:.3f}")  # not -0.000
        for extraction in OWNERS.values():
            cells += reading(outcome, rows[outcome.model, outcome.variant, extraction])
        traces = traces_by_seed(job) if outcome.variant == GAUGE else []
        yield [*cells, *(f"{extreme(traces):.2f}" if traces else "" for extreme in (min, max))]


def main() -> None:
    """Put the rows of some results into the table, in place of older ones of the same models and attacks."""
    columns = [*COLUMNS, *(f"{owner}_{name}" for owner in OWNERS for name in READING), "least_trace", "largest_trace"]
    with TABLE.open(newline="", encoding="utf-8") as file:
        rows: dict[tuple[str, ...], Sequence[str]] = {tuple(row[:3]): row for row in [*csv.reader(file)][1:]}
    for results in sys.argv[1:]:
        rows |= {tuple(row[:3]): row for row in table(Path(results))}
    in_order = sorted(rows, key=lambda cells: cells[:2])
    write_text(TABLE, csv_text(columns, [rows[cells] for cells in in_order]))


if __name__ == "__main__":
    main()
