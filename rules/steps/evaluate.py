"""Evaluate jobs of one model: variants, or all negative controls, whose names are then listed in a file."""

from pathlib import Path

from gspure.evaluation.evaluate import write
from gspure.evaluation.plan import Job
from gspure.evaluation.searching import searched
from gspure.files import write_json
from gspure.workflow.step import run


def evaluate_jobs(jobs: tuple[Job, ...], listed: Path | None = None) -> None:
    for job in jobs:
        write(job, searched(job))
    if listed:
        write_json(listed, [job.variant for job in jobs])


run(evaluate_jobs)
