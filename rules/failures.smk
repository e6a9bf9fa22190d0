# A failed job has no results, and the jobs that need them do not run. A second Snakemake process then makes tables and report
# from the finished results; they name the missing ones with the reason.

import atexit
import subprocess
import sys

from snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry

from gspure.failures import Failure, failures_below, is_interrupted, reason_in, status_of, summary, unfinished
from gspure.workflow.job_progress import COMMAND
from gspure.workflow.notes import note_of
from gspure.workflow.options import profile_options

# In that process: the failures of the first run. If a figure fails in it, a third process leaves this figure out, too.
RUNS = list(filter(None, os.environ.get("GSPURE_FAILED_RUNS", "").split(os.pathsep)))
FAILURES = [failure for failure in failures_below(Path("results/logs")) if failure.run in RUNS]
MISSING = {path for failure in FAILURES for path in failure.missing}


def get_finished(paths):
    """Return the results that are not missing because of a failed job."""
    return [path for path in paths if not {path, os.path.dirname(path)} & MISSING]


def get_summaries():
    """Return the jobs that also run on partial results: the tables, and all jobs that need them."""
    tables = [job for job in workflow.dag.jobs if job.rule.name in {"retrieve_message", "tabulate_metrics"}]
    return set(workflow.dag.bfs(workflow.dag.depending, *tables))


def get_jobs(failed):
    """Return the jobs of a failed group, or the one failed job."""
    return set(failed.jobs if failed.is_group() else [failed])


def record_failures(run):
    """Write a status for every job of this run that failed, and delete those of jobs that succeeded."""
    for job in workflow.dag.finished_jobs:
        for path in job.log:
            status_of(path).unlink(missing_ok=True)
    failed = map(get_jobs, workflow.scheduler.failed)
    stopped = bool(workflow.scheduler._user_kill)
    logs = {get_last(jobs).log[0]: jobs for jobs in failed}
    return [record_failure(jobs, run) for log, jobs in logs.items() if not is_interrupted(Path(log), stopped=stopped)]


def get_last(jobs):
    """Return the last job of a group that ran."""
    return max(jobs, key=lambda job: os.path.getmtime(job.log[0]) if os.path.exists(job.log[0]) else 0)


def record_failure(jobs, run):
    """Write and return the status of a failed job, or of the last one of a group that ran."""
    last = get_last(jobs)
    unmade = jobs | set(workflow.dag.bfs(workflow.dag.depending, *jobs)) - get_summaries()
    missing = sorted(str(path) for job in unmade for path in job.output)
    reason = reason_in(Path(last.log[0]), last.rule.name)
    failure = Failure(last.rule.name, reason, str(last.log[0]), run, missing)
    failure.write()
    return failure


def summarize(run):
    """Make tables and report from the finished results; return those that remain from an earlier run."""
    failed = set().union(*map(get_jobs, workflow.scheduler.failed))
    waiting = {job for job in get_summaries() - failed if job.output and not workflow.dag.finished(job)}
    last = [job for job in waiting if not waiting & workflow.dag.depending[job].keys()]
    if not (targets := [path for job in last for path in job.output]):
        return []
    local = ExecutorPluginRegistry().get_plugin("local").common_settings
    settings = shlex.split(workflow.spawned_job_args_factory.general_args(local))
    settings.remove("--no-hooks")
    command = [sys.executable, "-m", "snakemake", *targets, "--snakefile", workflow.main_snakefile]
    command += [*profile_options(Path(workflow.basedir)), *settings]
    runs = os.pathsep.join([*RUNS, run])
    if SCREEN:
        SCREEN.close()
    before = {path: os.path.getmtime(path) for path in targets if os.path.exists(path)}
    subprocess.run(command, env={**os.environ, "GSPURE_FAILED_RUNS": runs}, check=False)
    return [path for path in before if os.path.exists(path) and os.path.getmtime(path) == before[path]]


def print_failures(failures, run, outdated):
    """Print failed jobs with reasons, variants without results, outdated results, log, and the command to try again."""
    count = f"{len(failures)} jobs" if len(failures) > 1 else "1 job"
    lines = [f"gspure: {count} failed", *(f"  {line}" for line in summary(failures))]
    lines += [f"Without results: {model}: {', '.join(variants)}" for model, variants in unfinished(failures).items()]
    lines += [f"Of an earlier run: {path}" for path in outdated]
    lines.append(f"Snakemake's log: {os.path.relpath(run)}")
    if not RUNS:
        again = os.environ.get(COMMAND) or shlex.join(["snakemake", *sys.argv[1:]])
        lines.append(f"To try again: {again}")
    print(*lines, sep="\n", file=sys.stderr)


onsuccess:
    record_failures(log[0])


onerror:
    failures = record_failures(log[0])
    stopped = workflow.scheduler.running or workflow.scheduler.open_jobs
    outdated = []
    if workflow.execution_settings.keep_going and not stopped and len(RUNS) < 2:
        outdated = summarize(log[0])
    if failures:
        atexit.register(print_failures, failures, log[0], outdated)  # after Snakemake's last message
