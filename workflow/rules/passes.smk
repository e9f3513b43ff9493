# The passes of a case, by their numbers. The files of pass p lie in passes/<p>/, so that a pass added later does not
# change the files of earlier passes. Rules of a single pass have the wildcard "p".

from snakemake.io import strip_wildcard_constraints

PASSES = dict(enumerate(CASE.passes, start=1))


wildcard_constraints:
    p="[0-9]+",


def every_pass(files, p=PASSES):
    """Files of a rule in all passes, or in the pass ``p``."""
    names = [files] if isinstance(files, str) else files
    # Snakemake has written the constraint of the wildcard into the outputs of rules
    plain = [strip_wildcard_constraints(name) for name in names]
    return expand(plain, p=p, allow_missing=True)


def of_pass(stage):
    """Parameters of a rule in the pass of its wildcard."""
    return lambda wildcards: STAGES[stage].params(PASSES[int(wildcards.p)])


def measured_files(wildcards):
    """Files of the measured image in the pass of the wildcard."""
    prefix = f"measurement.{wildcards.p}." if len(PASSES) > 1 else "measurement."
    return [FILES[key] for key in FILES if key.startswith(prefix)]
