"""The terminal: what is missing, what is said while a run is at work, why something runs again, and the last line.

Snakemake's own words are as its profile wants them: profiles/default shows bars (snakemake-logger-plugin-rich) and leaves
what the jobs print to their logs, profiles/plain shows all that Snakemake and the jobs say. What is said here is beside
that, in both.
"""

import atexit
import logging
import shlex
import threading
from collections import Counter

from snakemake.common import NOTHING_TO_BE_DONE_MSG
from snakemake.logging import logger
from snakemake.persistence import ParamsChange
from snakemake_interface_logger_plugins.common import LogEvent

from dior import shortage
from dior.errors import MOST_FAULTS
from dior.project import missing, project, rerun_reasons
from dior.project.forget import left
from dior.release import citation

# chosen: somebody who looks at a log in a batch system every few minutes sees that it lives
EVERY_S = 60
# how Snakemake begins to say that it was told to end, by Ctrl-C and by SIGTERM
TOLD_TO_END = ("Terminating processes on user request", "Will exit after finishing currently")
# what is said when this process ends, when Snakemake has said all
LAST_LINES = []
DRY = {"-n", "--dry-run", "--dryrun"}


class Jobs(logging.Handler):
    """Hears what Snakemake says of its jobs: how many of each rule are at work, how many are done, which logs are of
    jobs that failed; and that there is nothing to do, after which no hook is called."""

    def __init__(self):
        super().__init__()
        self.rules, self.failed, self.done, self.total = {}, [], 0, 0
        self.told_to_end = False

    def emit(self, record):
        event = getattr(record, "event", None)
        if event == LogEvent.JOB_INFO:
            self.rules[record.jobid] = step_of(record.rule_name)
        elif event == LogEvent.JOB_FINISHED:
            self.rules.pop(record.job_id, None)
        elif event == LogEvent.JOB_ERROR:
            self.rules.pop(record.jobid, None)
            self.failed += [path for path in record.log if path not in self.failed]
        elif event == LogEvent.PROGRESS:
            self.done, self.total = record.done, record.total
        elif record.msg == NOTHING_TO_BE_DONE_MSG:
            say_what_to_open()
        elif str(record.msg).startswith(TOLD_TO_END):
            self.told_to_end = True

    def at_work(self):
        """`12 of 63 jobs done; at work: clocks 2, frames`."""
        counted = sorted(Counter(self.rules.values()).items())
        names = [f"{name} {count}" if count > 1 else name for name, count in counted]
        return f"{self.done} of {self.total} jobs done; at work: {', '.join(names) or 'none'}"


JOBS_HEARD = Jobs()


def show_bars():
    """Where bars are shown: keep what the jobs print off the screen, and without a screen say every minute that it lives."""
    if not workflow.output_settings.log_handler_settings:
        return
    # Snakemake and the bars write to standard error
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.close(silence)
    if not sys.stderr.isatty():
        threading.Thread(target=say_that_it_lives, daemon=True).start()


def say_that_it_lives():
    while True:
        time.sleep(EVERY_S)
        minutes = (time.time() - BEGUN) / 60
        print(f"{minutes:.0f} min: {JOBS_HEARD.at_work()}", file=sys.stderr, flush=True)


class Told(ParamsChange):
    """A change of params that is told in words: Snakemake would print all values."""

    words = ""

    def __str__(self):
        return self.words


def tell_what_is_missing(started):
    """Of a dry run, and with `--config strict=true`; where no walk could run, or with that, nothing is planned.

    A real run labels the walks that it can, and the steps of the others say what is wrong.
    """
    if not started.is_main_process or not (started.dryrun or STRICT):
        return
    (_, lines), _ = project.sheets(os.getcwd())
    faults = missing.of_project(PROJECT, lines)
    if not faults:
        return
    told = dict.fromkeys(map(str, faults))
    LAST_LINES.extend(list(told)[:MOST_FAULTS])
    more = f", of which {MOST_FAULTS} are said above" if len(told) > MOST_FAULTS else ""
    LAST_LINES.append(f"{len(told)} missing{more}; `dior check` looks into the recordings, too")
    if STRICT or missing.nothing_could_run(PROJECT, faults):
        raise WorkflowError("what the sheets name is not there")


class PlanAlone(logging.Filter):
    """Of a dry run with bars only the plan is said, and what is wrong."""

    def filter(self, record):
        begins = getattr(record, "event", None) == LogEvent.WORKFLOW_STARTED
        # what this run is Snakemake knows when it has begun
        dry = workflow.dryrun or begins and DRY & set(sys.argv)
        return not dry or record.levelno >= logging.ERROR


def tell_plan(dag, changed):
    """What a run would do, by step, and why. `changed`: by job what has changed of its parameters, in words."""
    steps = {}
    for job in dag.needrun_jobs(exclude_finished=False):
        if job.output:
            steps.setdefault(step_of(job.rule.name), []).append(
                why_of(dag, job, changed.get(job, []))
            )
    order = {step: at for at, step in enumerate(MODULES)}
    jobs = {
        step: steps[step] for step in sorted(steps, key=lambda step: order.get(step, len(order)))
    }
    print(*rerun_reasons.plan(jobs), sep="\n", file=sys.stderr)
    if not steps:
        say_what_to_open()


def why_of(dag, job, changed):
    """Why a job would run, in words."""
    reason, made = dag.reason(job), dag.dependencies[job]
    if reason.missing_output:
        return ["not made yet"]
    remade = {
        step_of(other.rule.name)
        for other, files in made.items()
        if files & reason.updated_input_run
    }
    newer = sorted(set(reason.updated_input) - set(reason.updated_input_run))
    return [
        *(["cut short"] if reason.incomplete_output else []),
        *(["asked for, or a file of it is gone"] if reason.forced else []),
        *changed,
        *(["other files than before"] if reason.input_changed and not changed else []),
        *(f"{path} is newer" for path in newer if path not in changed),
        *(f"{rerun_reasons.AFTER}{step}" for step in remade),
    ]


def tell_why(dag):
    """Say why jobs run again that have run before: in what Snakemake says of each job, and once for all of them."""
    if not workflow.is_main_process:
        return
    why, changed = Counter(), {}
    for job in dag.needrun_jobs(exclude_finished=False):
        reason = dag.reason(job)
        # of a job that runs anyway, because of one before it, Snakemake has not asked
        change = reason.params_changed or dag.workflow.persistence.params_changed(job)
        if not change:
            continue
        words = rerun_reasons.words(
            step_of(job.rule.name),
            dict(job.params.items()),
            change.only_old,
            change.only_new,
            CONFIG,
        )
        why.update(words)
        changed[job] = words
        if reason.params_changed:
            reason.params_changed = Told(change.only_old, change.only_new, change.files)
            reason.params_changed.words = "; ".join(words)
    if workflow.dryrun and workflow.output_settings.log_handler_settings:
        tell_plan(dag, changed)
    elif why:
        logger.info(f"Runs again because of: {rerun_reasons.together(why)}")


def say_what_to_open():
    """The end of a run: what came out, and where to look."""
    if stale := left("."):
        LAST_LINES.append(
            f"results/ and logs/ still hold {len(stale)} files and folders of sequences or people that the project no "
            "longer has: `dior forget` lists them, docs/people.md tells more"
        )
    ran = {job.rule.name for job in workflow.dag.needrun_jobs(exclude_finished=False)}
    if "to_mark" in ran:
        LAST_LINES.append(
            "Fill in the rows of results/evaluate/to_mark/, then copy boxes/ and checks/ of it to config/"
        )
    if "package" in ran:
        LAST_LINES.extend(
            f"Before others cite it: {line}" for line in citation.lacks(CONFIG["release"])
        )
        LAST_LINES.append(
            f"The release is made: {os.path.abspath(RELEASE)}; to check it: dior verify {shlex.quote(RELEASE)}"
        )
    pages = ["results/report/index.html", "results/reid/index.html"]
    LAST_LINES.extend(f"Open {os.path.abspath(page)}" for page in pages[1:] if os.path.exists(page))
    page, verdict = pages[0], "results/report/verdict.txt"
    if os.path.exists(page):
        text = ""
        # one that this run was not about may say what is no longer so
        if os.path.exists(verdict) and any(job.rule.name == "report" for job in workflow.dag.jobs):
            with open(verdict, encoding="utf-8") as stream:
                text = f"{stream.read().strip()} "
        LAST_LINES.append(f"{text}Open {os.path.abspath(page)}")


def say_what_failed():
    """The end of a run that failed: the last line of the log of each job that did, which says why."""
    page = "results/report/index.html"
    if os.path.exists(page) and os.path.getmtime(page) < BEGUN:
        LAST_LINES.append(f"{page} is still that of an earlier run")
    # jobs that were ended with the run do not say why
    if JOBS_HEARD.told_to_end or not JOBS_HEARD.failed:
        LAST_LINES.append(
            "The run was ended before all was done; type the same line again to go on"
        )
        return
    for path in filter(os.path.exists, JOBS_HEARD.failed):
        with open(path, encoding="utf-8", errors="replace") as stream:
            LAST_LINES.append(f"{path}: {shortage.last_words(stream.read())}")


def say_last_lines():
    for line in LAST_LINES:
        print(line, file=sys.stderr)


if workflow.is_main_process:
    logger.addHandler(JOBS_HEARD)
    if workflow.output_settings.log_handler_settings:
        logger.addFilter(PlanAlone())
    atexit.register(say_last_lines)
