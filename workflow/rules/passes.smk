# The passes of a case. The files of the first pass lie in the case's folder, and the files of pass 2 and later passes p
# in passes/<p>/, so that a pass added later does not change the files of earlier passes. Rules of a single pass have
# the wildcard "at".

from snakemake.io import strip_wildcard_constraints

PASSES = {
    f"passes/{number}/" if number > 1 else "": one
    for number, one in enumerate(CASE.passes, start=1)
}


wildcard_constraints:
    at="(passes/[0-9]+/)?",


def every_pass(files, at=PASSES):
    """Files of a rule in all passes, or in the passes named by ``at``."""
    names = [files] if isinstance(files, str) else files
    # Snakemake has written the constraint of the wildcard into the outputs of rules
    plain = [strip_wildcard_constraints(name) for name in names]
    return expand(plain, at=at, allow_missing=True)


def of_pass(stage):
    """Parameters of a rule in the pass of its wildcard."""
    return lambda wildcards: STAGES[stage].params(PASSES[wildcards.at])


def inputs_of(section):
    """Input files of a section of the configuration in the pass of the wildcard."""

    def files(wildcards):
        number = [*PASSES].index(wildcards.at) + 1
        prefix = f"{section}.{number}." if number > 1 else f"{section}."
        others = tuple(
            f"{section}.{k}." for k in range(2, len(PASSES) + 1) if k != number
        )
        return [
            FILES[key]
            for key in FILES
            if key.startswith(prefix) and not key.startswith(others)
        ]

    return files
