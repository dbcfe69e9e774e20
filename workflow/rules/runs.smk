"""Runs: how Snakemake's planning is made to see what it alone would not.

1. Every file has to be there that the target was made from. Snakemake looks for what lacks only among the files of the
   target. As a step that fails loses its results and its inputs are noted all the same, the next run would find the
   report newer than all else, and nothing to do.
2. The time of a result is the one that was noted when it was made. A copy of a project, whose files got other times in
   another order, would else be made again.
3. Where a file lacks that SHA256SUMS names, the release or the exports are made again: their rules do not name all.
   Nor does that of the report, whose first page links to them.
4. A job whose input is made again, but counts as old (`ancient`), is asked whether it has to run for another reason.
   Snakemake takes it for one that will run anyway, and does not ask: a changed param would wait for the next run.
5. One run at a time, and the second says which is the first.
6. What the sheets name and is not there is no input of the rules, so a dry run would not miss it.

What it has planned is told in words (terminal.smk).
"""

from snakemake.dag import DAG
from snakemake_interface_storage_plugins.io import Mtime

from dior.project import licenses, running


def of_dior(update_needrun):
    """The planning of Snakemake, told all that."""

    async def planned(dag, *args, **kwargs):
        begin_run(dag.workflow)
        tell_what_is_missing(dag.workflow)
        recall_times(dag)
        dag.forcefiles.update(made_without_all(dag))
        targets, dag.targetjobs = dag.targetjobs, set(dag.jobs)
        dag.bfs = made_again
        try:
            await update_needrun(dag, *args, **kwargs)
        finally:
            dag.targetjobs = targets
            del dag.bfs
        check_license(dag)
        tell_why(dag)

    planned.is_of_dior = True
    return planned


def made_again(depending, *jobs):
    """The jobs, and those that will run because these do; Snakemake's own search goes through ancient files, too."""
    found, waiting = set(jobs), list(jobs)
    while waiting:
        job = waiting.pop()
        yield job
        for other, files in depending[job].items():
            if other not in found and not all(file.is_ancient for file in files):
                found.add(other)
                waiting.append(other)


def recall_times(dag):
    """Let Snakemake believe that each result, and the benchmark of its job, is as old as .snakemake/metadata says."""
    times, notes = dag.workflow.iocache.mtime, dag.workflow.persistence
    for job in dag.jobs:
        noted = [(path, notes.metadata(path)) for path in job.output]
        made = {path: Mtime(local=note.endtime) for path, note in noted if note and note.endtime}
        times.update(made)
        if job.benchmark and made:
            times[job.benchmark] = next(iter(made.values()))


def made_without_all(dag):
    """The SHA256SUMS and pages that name a file which is not there any more: who made them makes all of it again."""
    named_in = {"SHA256SUMS": in_sums, "index.html": in_page}
    made = {path for job in dag.jobs for path in job.output if os.path.exists(path)}
    return [
        path
        for path in made
        if (names := named_in.get(os.path.basename(path))) and lost(path, names)
    ]


def lost(path, names):
    """Whether a file is gone that another one names."""
    with open(path, encoding="utf-8", errors="replace") as stream:
        named = names(stream.read())
    return not all(os.path.exists(os.path.join(os.path.dirname(path), name)) for name in named)


def in_sums(text):
    """The files that a list of checksums names, as `sha256sum` writes it: 64 digits, two blanks, the name."""
    return [line[66:] for line in text.splitlines()]


def in_page(text):
    """The files that a page links to, beside it."""
    return re.findall(r'(?:src|href|poster)="([^":#]+)(?:#[^"]*)?"', text)


def check_license(dag):
    """What a release lacks is said before the hours that it takes."""
    if any(job.rule.name == "package" for job in dag.needrun_jobs(exclude_finished=False)):
        try:
            licenses.check_chosen(CONFIG["release"])
        except DiorError as error:
            refuse(error)


def refuse(error):
    """End the run with a sentence of dior's, after which Snakemake prints where it came from."""
    LAST_LINES.append(str(error))
    raise WorkflowError(str(error)) from None


def begin_run(started):
    """Hold the folder, before Snakemake looks for its own lock, which says neither who nor since when."""
    if started.dryrun or not started.is_main_process or started.executor_plugin is None:
        return
    try:
        alone = running.begin(os.getcwd())
    except DiorError as error:
        refuse(error)
    if alone:
        # left by a run that was killed
        started.persistence.cleanup_locks()
        os.makedirs(".snakemake/locks", exist_ok=True)


if not hasattr(DAG.update_needrun, "is_of_dior"):
    DAG.update_needrun = of_dior(DAG.update_needrun)

# whoever unlocks a folder while a run lives in it would start a second one
if "--unlock" in sys.argv and (who := running.at_work(os.getcwd())):
    raise WorkflowError(f"{who}; there is nothing to unlock while it lives")
