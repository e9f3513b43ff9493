"""radcal: calibrate the backscatter laws of a SAR simulator against a measured image.

snakemake --cores 2                                     the default case
snakemake --cores 2 --configfile config/mine.yaml       a case of your own
snakemake --cores 2 reference                           one run: is everything wired?
snakemake --cores 2 design                              the initial runs only
"""

import os
import re
import sys
import time
from pathlib import Path

from snakemake.logging import logger
from snakemake.utils import min_version

from radcal import config as configuration
from radcal.calibration.history import read_runs
from radcal.calibration.reuse import check_reuse
from radcal.calibration.salvage import salvage
from radcal.calibration.simulator_change import simulator_change
from radcal.calibration.stopping import decide
from radcal.casefile import check_words
from radcal.errors import RadcalError
from radcal.jobs import CASE as CASE_NAME
from radcal.jobs import FAILURE, OWNER, PROGRESS, STARTED, Follower
from radcal.lock import CaseLock
from radcal.radar import SIMULATOR_VERSION
from radcal.records import REPLACE
from radcal.simulators.command import check_command
from radcal.simulators.seed_width import with_seed_bits
from radcal.stages import READS
from radcal.slurm import cancel_leftovers, remember

min_version("9.10")

if not workflow.configfiles:

    configfile: "config/config.yaml"


try:
    check_words(workflow.config_settings.config_args or ())
    CASE = with_seed_bits(configuration.load(workflow.configfiles, config), "results")
    FILES = configuration.input_files(CASE)
    check_command(CASE)
    check_reuse(CASE, "results")
except RadcalError as error:
    sys.exit(f"radcal: {error}")

OUT = f"results/{CASE.case}"
config["stop"] = CASE.sections("stop")["stop"]  # as scripts are to see it
LOCK = CaseLock(OUT)
# A damaged file would stop the job that reads it; set aside before jobs are planned, it is made again. The jobs'
# own processes read this page too, and a dry run changes nothing.
GONE = []
if workflow.is_main_process and not any(
    re.fullmatch("--dry-?run|-[a-z]*n[a-z]*", word) for word in sys.argv
):
    GONE, sentences = salvage(OUT, CASE.case)
    for sentence in sentences + simulator_change(OUT, CASE):
        sys.stderr.write(f"radcal: {sentence}\n")
os.environ[CASE_NAME] = CASE.case
os.environ.pop(REPLACE, None)
if CASE.replace:
    os.environ[REPLACE] = "1"
os.environ[OWNER] = str(os.getpid())
os.environ[FAILURE] = os.path.abspath(f"{OUT}/logs/failure.txt")
if workflow.remote_exec:
    # a job on a cluster reads this file anew: the clock is that of whoever submitted it
    os.environ.setdefault(STARTED, str(time.time()))
    os.environ[PROGRESS] = os.path.abspath(f"{OUT}/logs/progress.txt")
else:
    os.environ[STARTED] = str(time.time())
    os.environ.pop(PROGRESS, None)

# One line per finished run is for people. What Snakemake says between any two is left out, and
# what it adds to a failure that a job has explained in its own sentence.
ROUTINE = ("Select jobs to", "Execute ", "DAG of jobs will be", "Updating checkpoint")
AFTERMATH = ("RuleException", "Shutting down", "Exiting because", "WorkflowError")
INTERRUPTED = []


def for_people(record):
    text = str(record.msg)
    if text.startswith("Terminating processes on user request"):
        INTERRUPTED.append(text)
        return False
    explained = text.startswith(AFTERMATH) and (
        INTERRUPTED or os.path.exists(os.environ[FAILURE])
    )
    return not (text.startswith(ROUTINE) or explained)


logger.addFilter(for_people)
FOLLOWERS = []


def follow():
    """Have jobs on a cluster heard here, and found by who comes after a kill."""
    FOLLOWERS.append(Follower(f"{OUT}/logs/progress.txt"))
    # of Snakemake's plugin for Slurm: the name of all jobs of this invocation
    name = getattr(workflow.scheduler._executor, "run_uuid", None)
    if workflow.executor_plugin.name == "slurm" and name is not None:
        remember(f"{OUT}/.slurm", name)


def unfollow():
    """Snakemake has seen its jobs to their end: there is nothing to hear or to find any more."""
    while FOLLOWERS:
        FOLLOWERS.pop().stop()
        if os.path.exists(f"{OUT}/.slurm"):
            os.remove(f"{OUT}/.slurm")


include: "workflow/rules/resources.smk"
include: "workflow/rules/scene.smk"
include: "workflow/rules/simulator.smk"
include: "workflow/rules/measurement.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/loop.smk"
include: "workflow/rules/report.smk"


def again(wildcards):
    """What was damaged, even where it is only read if something else changes; leftovers of other settings are not."""
    made = {
        f"{OUT}/{path.name}"
        for path in GONE
        if path.name != "simulator.json" or SIMULATOR
    }
    made |= {f"{OUT}/design/{chunk}.json" for chunk in CHUNKS}
    return sorted(made & {str(path) for path in GONE})


localrules:
    all,
    reference,
    design,
    stop_settings,
    summary,


rule all:
    default_target: True
    input:
        f"{OUT}/summary.json",
        # the walk over the iterations stands here too: with only the last file as a target, a
        # finished loop whose tolerance is tightened would be found complete
        verified,
        again,


rule reference:
    input:
        f"{OUT}/reference.json",


rule design:
    input:
        f"{OUT}/scores.json",


onstart:
    LOCK.acquire()
    try:
        if cancelled := cancel_leftovers(f"{OUT}/.slurm"):
            sys.stderr.write(
                f"radcal: {cancelled} jobs of an earlier snakemake cancelled; finished runs are kept.\n"
            )
    except RadcalError as error:
        sys.stderr.write(f"radcal: {error}\n")
        sys.stderr.flush()
        # as the lock does: no job has started, and Snakemake would add a traceback
        os._exit(1)
    if os.path.exists(os.environ[FAILURE]):
        os.remove(os.environ[FAILURE])
    if not workflow.local_exec:
        follow()


onsuccess:
    unfollow()
    LOCK.release()


onerror:
    unfollow()
    LOCK.release()
    if INTERRUPTED:
        finished = len(list(Path(f"{OUT}/runs").glob("[!.]*.h5")))
        sys.stderr.write(
            f"radcal: stopped by Ctrl-C. {finished} finished runs are kept in {OUT}/runs; the same command goes on "
            "from there.\n"
        )
        return
    sys.stderr.write(
        f"radcal: stopped. Finished runs are kept in {OUT}/runs, logs in {OUT}/logs; once the cause is mended, "
        "the same command continues.\n"
    )
