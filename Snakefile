"""radcal: calibrate the backscatter laws of a SAR simulator against a measured image.

snakemake --cores 2                                     the default case
snakemake --cores 2 --configfile config/mine.yaml       a case of your own
snakemake --cores 2 reference                           one run, to test the setup
snakemake --cores 2 design                              the initial runs only
snakemake --cores 2 products                            products of the calibrated laws (section products)
"""

import atexit
import sys

from snakemake.logging import logger
from snakemake.utils import min_version

from radcal.forecast.runs_and_time import planned_runs, runs_sentence, stages_sentence
from radcal.session.session import (
    is_dry_run,
    is_finished,
    is_planned,
    open_session,
    say,
)
from radcal.session.slurm import job_name

min_version("9.10")

if not workflow.configfiles:

    configfile: "config/config.yaml"


SESSION = open_session(
    workflow.configfiles,
    config,
    workflow.config_settings.config_args or (),
    remote=workflow.remote_exec,
    logger=logger,
    main=workflow.is_main_process,
)
CASE, FILES, OUT = SESSION.case, SESSION.inputs, SESSION.folder
config["stop"] = CASE.sections("stop")["stop"]  # with all defaults, for the scripts
# for words on the time left alone, so that no job depends on it
config["design_size"] = CASE.design_size


include: "workflow/rules/stages.smk"
include: "workflow/rules/scene.smk"
include: "workflow/rules/simulator.smk"
include: "workflow/rules/measurement.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/loop.smk"
include: "workflow/rules/report.smk"


def results(wildcards):
    """Outputs of a finished case: those of every stage that the case needs."""
    k = len(verified(wildcards))
    needed = [stage for stage in STAGES.values() if stage.is_needed(CASE)]
    return sorted(f"{OUT}/{file}" for stage in needed for file in stage.files(CASE, k))


# Damaged files are set aside only by the main process (the processes of the jobs read the Snakefile too), and not in a
# dry run, which must change nothing.
if workflow.is_main_process and not is_dry_run(sys.argv):
    SESSION.set_damaged_aside()


# The last words of a dry run, and of a command that finds nothing to do: Snakemake calls no hook for either.
@atexit.register
def say_last_words():
    if not workflow.is_main_process:
        return
    if is_finished(workflow):
        SESSION.say_verdict()
    if is_planned(workflow):
        # to Snakemake the jobs of a dry run have ended
        planned = set(workflow.dag.needrun_jobs(exclude_finished=False))
        # in the order of their dependencies
        layers = workflow.dag.toposorted(planned)
        jobs = [
            (job.rule.name, job.wildcards_dict) for layer in layers for job in layer
        ]
        say(stages_sentence(jobs))
        say(runs_sentence(planned_runs(CASE, jobs), CASE.simulator.draws))


localrules:
    all,
    reference,
    design,


rule all:
    default_target: True
    input:
        # the summary is named here as well, because a dry run does not know the number of iterations
        f"{OUT}/summary.json",
        # All outputs are requested, so that a deleted intermediate file is made again, and a finished loop continues
        # when its tolerance has been tightened.
        results,


rule reference:
    input:
        every_pass(rules.reference_run.output.index),


rule design:
    input:
        f"{OUT}/scores.json",


onstart:
    SESSION.start(job_name(workflow), remote_jobs=not workflow.local_exec)


onsuccess:
    SESSION.end()


onerror:
    SESSION.end(failed=True)
