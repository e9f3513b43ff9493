# Resources that jobs request from a cluster, as functions, so that files are opened only for jobs that run.

from functools import cache

from radcal.errors import RadcalError
from radcal.forecast.memory_and_time import memory_mb, runtime_minutes, values_of


@cache
def case_values():
    try:
        return values_of(CASE)
    except RadcalError:
        # the job that makes the scene reports problems of its files
        return {"scene": 0, "image": 0}


def values(stage):
    return case_values()["scene" if stage == "scene" else "image"]


def memory(stage):
    def mem_mb(wildcards, attempt):
        return memory_mb(stage, values(stage), attempt)

    return mem_mb


def minutes(stage, runs=0):
    """Time that a job requests for a number of runs [min]."""

    def runtime(wildcards):
        return runtime_minutes(
            stage, values(stage), runs * CASE.simulator.longest_run_s
        )

    return runtime
