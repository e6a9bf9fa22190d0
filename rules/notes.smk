# Which results fit, by the notes of their jobs (gspure/workflow/notes.py). Snakemake compares times and settings, but not the
# content of results, and what it knows stays behind in .snakemake when results are copied.

import threading

from snakemake.scheduling.job_scheduler import JobScheduler

from gspure.artifacts import digest
from gspure.workflow.notes import NOTES, misfit, state_of, write_note


def get_settings(job):
    """Return a digest of all that a job depends on beside the content of files."""
    parts = [job.rule.name, job.rule.shellcmd, *job.input, *job.input.items(), *job.output, *job.params]
    return digest(*map(str, parts))


def get_paths(job):
    """Return all files and folders that a job reads or writes, with the cost of an attack."""
    return [str(path) for path in (*job.input, *job.output, cost_of(job.benchmark))]


def find_misfits(dag):
    """Return the jobs whose results do not fit, with the reason, except those that run anyway."""
    misfits, after = {}, set()
    for job in (job for level in dag.toposorted() for job in level if job.log):
        if job in after or dag.needrun(job) or dag.finished(job):
            continue
        if reason := misfit(job.log[0], get_settings(job), get_paths(job)):
            misfits[job] = reason
            after.update(dag.bfs(dag.depending, job))
    return misfits


def require_notes(dag):
    """Refuse results without any note, which are of another version or no results, unless all are to be replaced."""
    if NOTES.is_dir() or workflow.touch or workflow.dag_settings.forceall:
        return
    if result := next((path for job in dag.jobs for path in job.output if os.path.exists(path)), None):
        hint = "delete the results, or add --forceall to replace them, or --touch to accept them"
        print(f"gspure: {result}: expected the notes of a run in {NOTES}, found none; {hint}", file=sys.stderr)
        sys.exit(2)


def handle_sigterm_in_a_thread(scheduler):
    """Let a thread wait for the lock that Snakemake's handler needs: the interrupted main thread may hold it."""
    end = scheduler.exit_gracefully
    scheduler.exit_gracefully = lambda *arguments: threading.Thread(target=end, args=arguments).start()


def keep_notes(dag, persistence):
    """Let finished jobs leave their notes; of inputs that other jobs of a group still make, the state before is unknown."""
    states = {}

    def started(job, *arguments, start=persistence.started):
        NOTES.mkdir(parents=True, exist_ok=True)
        unmade = (
            files for maker, files in dag.dependencies[job].items() if dag.needrun(maker) and not dag.finished(maker)
        )
        states[job] = {str(path): state_of(str(path)) for path in {*job.input}.difference(*unmade)}
        start(job, *arguments)

    async def finished(job, finish=persistence.finished):
        await finish(job)
        if job.log:
            write_note(job.log[0], get_settings(job), get_paths(job), states.pop(job, {}))

    persistence.started, persistence.finished = started, finished


def build_dag(build=workflow._build_dag):
    """Force the jobs whose results do not fit, which Snakemake takes for up to date."""
    dag, misfits = workflow.dag, {}

    async def update_needrun(*arguments, update=dag.update_needrun, **options):
        await update(*arguments, **options)
        if not RUNS and (unfit := find_misfits(dag)):
            misfits.update(unfit)
            dag.forcefiles |= {path for job in unfit for path in job.output}
            await update()

    dag.update_needrun = update_needrun
    keep_notes(dag, workflow.persistence)
    build()
    require_notes(dag)
    for reason in misfits.values():
        print(f"gspure: to be recomputed: {reason}", file=sys.stderr)


if workflow.is_main_process:
    workflow._build_dag = build_dag
    handle_sigterm_in_a_thread(JobScheduler)
