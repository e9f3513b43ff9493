# What the rules take from the table of stages (radcal.config.stages), and the passes of a case by their numbers.

from functools import cache

from snakemake.io import strip_wildcard_constraints

from radcal.config.stages import STAGES
from radcal.errors import RadcalError
from radcal.forecast.memory_and_time import memory_mb, runtime_minutes, values_of

# The files of pass p lie in passes/<p>/, so that a pass added later does not change the files of earlier passes. Rules
# of a single pass have the wildcard "p".
PASSES = dict(enumerate(CASE.passes, start=1))


wildcard_constraints:
    p="[0-9]+",
    s="[0-9]+",


def outputs(stage, **flags):
    """Outputs of a stage by name; functions such as ``update`` mark those of the same name for Snakemake."""
    made = STAGES[stage].outputs
    return {name: flags.get(name, str)(f"{OUT}/{path}") for name, path in made.items()}


def words(stage):
    """Message of the jobs of a stage."""
    return STAGES[stage].words.replace("{", "{wildcards.")


def every_pass(files, p=PASSES):
    """Files of a rule in all passes, or in the pass ``p``."""
    names = [files] if isinstance(files, str) else files
    # Snakemake has written the constraint of the wildcard into the outputs of rules
    plain = [strip_wildcard_constraints(name) for name in names]
    return expand(plain, p=p, allow_missing=True)


def of_pass(stage):
    """Sections of the configuration that a stage reads, in the pass of the wildcard."""
    return lambda wildcards: STAGES[stage].params(PASSES[int(wildcards.p)])


def measured_files(wildcards):
    """Files of the measured image in the pass of the wildcard."""
    prefix = f"measurement.{wildcards.p}." if len(PASSES) > 1 else "measurement."
    return [FILES[key] for key in FILES if key.startswith(prefix)]


@cache
def case_values():
    try:
        return values_of(CASE)
    except RadcalError:
        # the job that makes the scene reports problems of its files
        return {"scene": 0, "image": 0}


def resources(stage, runs=0, parts=1):
    """Resources that a job requests from a cluster, as functions, so that files are opened only for jobs that run.

    A job computes one of ``parts`` equal parts of the case.
    """
    simulation_s = runs * CASE.simulator.longest_run_s

    def part_values():
        return {name: value // parts for name, value in case_values().items()}

    def mem_mb(wildcards, attempt):
        return memory_mb(stage, part_values(), attempt)

    def runtime(wildcards):
        return runtime_minutes(stage, part_values(), simulation_s)

    return {"mem_mb": mem_mb, "runtime": runtime}
