# The final runs, the archive, exports, figures, report and summary.


def subject(wildcards):
    """Category of a figure in Snakemake's report: the material in its file's name, or the whole case."""
    return wildcards.get("material", "Whole case")


rule final_runs:
    input:
        every_pass(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified,
    output:
        **outputs("final_runs"),
    log:
        f"{OUT}/logs/final_runs.log",
    benchmark:
        f"{OUT}/benchmarks/final_runs.tsv"
    resources:
        **resources("final_runs", runs=2 * len(PASSES)),
    params:
        case=STAGES["final_runs"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("final_runs")
    script:
        "../scripts/final_runs.py"


# Posterior of all laws, by one model of the cells of all materials: some ten seconds for each calibrated material.
rule posterior:
    input:
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        registered=every_pass(rules.registration.output.registered),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified,
        final=rules.final_runs.output.final,
    output:
        **outputs(
            "posterior",
            posterior=lambda path: expand(path, material=CASE.calibrated),
        ),
    log:
        f"{OUT}/logs/posterior.log",
    benchmark:
        f"{OUT}/benchmarks/posterior.tsv"
    retries: 0
    resources:
        **resources("posterior", runs=2 * len(PASSES)),
    params:
        case=STAGES["posterior"].params(CASE),
        runs=f"{OUT}/runs",
        draws=f"{OUT}/posterior/draws",
    message:
        words("posterior")
    script:
        "../scripts/posterior.py"


rule archive:
    input:
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        registered=every_pass(rules.registration.output.registered),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified,
        trained=trained_last,
        final=rules.final_runs.output.final,
        image=rules.posterior.output.image,
        posterior=rules.posterior.output.posterior,
    output:
        **outputs(
            "archive",
            table=lambda path: report(
                path, category="Tables", caption="../report/tables.rst"
            ),
            folder=lambda path: report(
                directory(path),
                patterns=["{table}.csv"],
                category="Tables",
                caption="../report/tables.rst",
            ),
        ),
    log:
        f"{OUT}/logs/archive.log",
    benchmark:
        f"{OUT}/benchmarks/archive.tsv"
    retries: 0
    resources:
        **resources("archive"),
    params:
        case=STAGES["archive"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        words("archive")
    script:
        "../scripts/archive.py"


# Products of the calibrated laws, made on demand alone: `snakemake --cores 2 products`.
rule products:
    input:
        every_pass(SIMULATOR),
        archive=rules.archive.output.archive,
    output:
        **outputs("products"),
    log:
        f"{OUT}/logs/products.log",
    benchmark:
        f"{OUT}/benchmarks/products.tsv"
    retries: 0
    resources:
        **resources("products", runs=(1 + CASE.products.draws) * len(PASSES)),
    params:
        case=STAGES["products"].params(CASE),
        runs=f"{OUT}/runs",
        folder=f"{OUT}/products",  # no output, of which a killed job would lose all
    message:
        words("products")
    script:
        "../scripts/products.py"


rule report:
    input:
        archive=rules.archive.output.archive,
    output:
        **outputs(
            "report",
            # of a material, or of the whole case
            figures=lambda path: report(
                directory(path),
                patterns=[
                    "{figure,held_out|[a-z]+}_{material}.png",
                    "{figure,[a-z]+}.png",
                ],
                category=subject,
                labels=lambda wildcards: {
                    "figure": wildcards.figure.replace("_", " ")
                },
                caption="../report/figures.rst",
            ),
            page=lambda path: report(
                path, category="Report", caption="../report/report.rst"
            ),
        ),
    log:
        f"{OUT}/logs/report.log",
    benchmark:
        f"{OUT}/benchmarks/report.tsv"
    retries: 0
    resources:
        **resources("report"),
    message:
        words("report")
    script:
        "../scripts/report.py"
