"""radcal: calibrate the backscatter laws of a SAR simulator against a measured image.

snakemake --cores 2                                     the default case
snakemake --cores 2 --configfile config/mine.yaml       a case of your own
snakemake --cores 2 reference                           one run: is everything wired?
snakemake --cores 2 design                              the initial runs only
"""

import math
import os
import re
import sys
import time

from snakemake.logging import logger
from snakemake.utils import min_version

from radcal import config as configuration
from radcal.calibration.history import read_runs
from radcal.calibration.stopping import decide
from radcal.errors import RadcalError
from radcal.calibration.salvage import salvage
from radcal.jobs import CASE as CASE_NAME
from radcal.jobs import FAILURE, OWNER, STARTED
from radcal.lock import CaseLock
from radcal.simulators.command import check_command

min_version("9.10")

if not workflow.configfiles:

    configfile: "config/config.yaml"


try:
    CASE = configuration.load(workflow.configfiles, config)
    FILES = configuration.input_files(CASE)
    check_command(CASE)
except RadcalError as error:
    sys.exit(f"radcal: {error}")

OUT = f"results/{CASE.case}"
LOCK = CaseLock(OUT)
# A damaged file would stop the job that reads it; set aside before jobs are planned, it is made again. The jobs'
# own processes read this page too, and a dry run changes nothing.
GONE = []
if workflow.is_main_process and not any(
    re.fullmatch("--dry-?run|-[a-z]*n[a-z]*", word) for word in sys.argv
):
    GONE, sentences = salvage(OUT, CASE.case)
    for sentence in sentences:
        sys.stderr.write(f"radcal: {sentence}\n")
os.environ[CASE_NAME] = CASE.case
os.environ[OWNER] = str(os.getpid())
os.environ[STARTED] = str(time.time())
os.environ[FAILURE] = os.path.abspath(f"{OUT}/logs/failure.txt")

# One line per finished run is for people. What Snakemake says between any two is left out, and
# what it adds to a failure that a job has explained in its own sentence.
ROUTINE = ("Select jobs to", "Execute ", "DAG of jobs will be", "Updating checkpoint")
AFTERMATH = ("RuleException", "Shutting down", "Exiting because")


def for_people(record):
    text = str(record.msg)
    explained = text.startswith(AFTERMATH) and os.path.exists(os.environ[FAILURE])
    return not (text.startswith(ROUTINE) or explained)


logger.addFilter(for_people)


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
    if os.path.exists(os.environ[FAILURE]):
        os.remove(os.environ[FAILURE])


onsuccess:
    LOCK.release()


onerror:
    LOCK.release()
    sys.stderr.write(
        f"radcal: stopped. Finished runs are kept in {OUT}/runs, logs in {OUT}/logs; once the cause is mended, "
        "the same command continues.\n"
    )
