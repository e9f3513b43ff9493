"""radcal: calibrate the backscatter laws of a SAR simulator against a measured image.

snakemake --cores 2                                     the default case
snakemake --cores 2 --configfile config/mine.yaml       a case of your own
snakemake --cores 2 reference                           one run: is everything wired?
snakemake --cores 2 design                              the initial runs only
"""

import re
import sys

from snakemake.logging import logger
from snakemake.utils import min_version

from radcal import config as configuration
from radcal.calibration.history import read_runs
from radcal.calibration.reuse import check_reuse
from radcal.calibration.stopping import decide
from radcal.config.casefile import check_words
from radcal.errors import RadcalError
from radcal.radar import SIMULATOR_VERSION
from radcal.running.session import Session
from radcal.simulators.command import check_command
from radcal.simulators.seed_width import with_seed_bits
from radcal.config.stages import STAGES
from radcal.running.terminal import guard

min_version("9.10")
guard(logger)

if not workflow.configfiles:

    configfile: "config/config.yaml"


try:
    check_words(workflow.config_settings.config_args or ())
    CASE = with_seed_bits(configuration.load(workflow.configfiles, config), "results")
    FILES = configuration.input_files(CASE)
    check_command(CASE)
    check_reuse(CASE, "results")
    SESSION = Session(CASE, remote=workflow.remote_exec)
except RadcalError as error:
    sys.exit(f"radcal: {error}")

OUT = f"results/{CASE.case}"
config["stop"] = CASE.sections("stop")["stop"]  # as scripts are to see it
logger.addFilter(SESSION.messages)


include: "workflow/rules/resources.smk"
include: "workflow/rules/scene.smk"
include: "workflow/rules/simulator.smk"
include: "workflow/rules/measurement.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/loop.smk"
include: "workflow/rules/report.smk"


OUTPUTS = {str(path) for made in workflow.rules for path in made.output}
UNUSED = {rules.simulator.output.identity, rules.reuse.output.index}
UNUSED -= {*SIMULATOR, *REUSED}


def results(wildcards):
    """All that a finished case holds. Leftovers of other settings, from iterations beyond the last, do not count."""
    numbers = {"chunk": CHUNKS, "k": range(len(verified(wildcards)))}
    return expand(sorted(OUTPUTS - UNUSED), **numbers)


# The jobs' own processes read this page too, and a dry run changes nothing.
if workflow.is_main_process and not any(
    re.fullmatch("--dry-?run|-[a-z]*n[a-z]*", word) for word in sys.argv
):
    SESSION.mend(OUTPUTS)


localrules:
    all,
    reference,
    design,
    stop_settings,
    summary,


rule all:
    default_target: True
    input:
        # also where a dry run cannot see how many iterations there will be
        f"{OUT}/summary.json",
        # not the last file alone: what is missing before it would stay missing, and a finished loop whose
        # tolerance is tightened would be found complete
        results,


rule reference:
    input:
        f"{OUT}/reference.json",


rule design:
    input:
        f"{OUT}/scores.json",


onstart:
    # of Snakemake's plugin for Slurm: the name of all jobs of this invocation
    slurm = workflow.executor_plugin.name == "slurm"
    SESSION.start(
        cluster=(
            getattr(workflow.scheduler._executor, "run_uuid", None)
            if slurm
            else None
        ),
        remote_jobs=not workflow.local_exec,
    )


onsuccess:
    SESSION.end()


onerror:
    SESSION.end(failed=True)
