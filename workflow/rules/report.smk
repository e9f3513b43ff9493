# The final runs, the archive, figures, report and summary.


rule final_runs:
    input:
        every_pass(SIMULATOR),
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified,
    output:
        final=f"{OUT}/final.json",
    log:
        f"{OUT}/logs/final_runs.log",
    benchmark:
        f"{OUT}/benchmarks/final_runs.tsv"
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", 2 * len(PASSES)),
    params:
        case=STAGES["final_runs"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "final runs"
    script:
        "../scripts/final_runs.py"


# Posterior distribution of one material's law. Sampling on the surrogate of all runs takes less than a minute.
rule posterior:
    input:
        target=every_pass(rules.target.output.target),
        scores=f"{OUT}/scores.json",
        verified=verified,
    output:
        posterior=f"{OUT}/posterior/{{material}}.h5",
    log:
        f"{OUT}/logs/posterior/{{material}}.log",
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("light"),
        runtime=minutes("light"),
    params:
        case=STAGES["posterior"].params(CASE),
    message:
        "posterior of {wildcards.material}"
    script:
        "../scripts/posterior.py"


rule archive:
    input:
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        registered=every_pass(rules.registration.output.registered),
        target=every_pass(rules.target.output.target),
        stop=rules.stop_settings.output.stop,
        scores=f"{OUT}/scores.json",
        verified=verified,
        final=rules.final_runs.output.final,
        posterior=expand(rules.posterior.output.posterior, material=CASE.calibrated),
    output:
        archive=f"{OUT}/calibration.h5",
        table=f"{OUT}/runs.csv",
        checksum=f"{OUT}/table.json",
    log:
        f"{OUT}/logs/archive.log",
    benchmark:
        f"{OUT}/benchmarks/archive.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("registration"),
        runtime=minutes("registration"),
    params:
        case=STAGES["archive"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "archive of all runs"
    script:
        "../scripts/archive.py"


rule export:
    input:
        archive=rules.archive.output.archive,
        scene=rules.scene.output.scene,
        geometry=every_pass(rules.geometry.output.geometry),
        registered=every_pass(rules.registration.output.registered),
        target=every_pass(rules.target.output.target),
        final=rules.final_runs.output.final,
    output:
        folder=directory(f"{OUT}/export"),
        checksums=f"{OUT}/export.json",
    log:
        f"{OUT}/logs/export.log",
    benchmark:
        f"{OUT}/benchmarks/export.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("measurement"),
        runtime=minutes("measurement"),
    params:
        case=STAGES["export"].params(CASE),
        runs=f"{OUT}/runs",
    message:
        "exports"
    script:
        "../scripts/export.py"


rule report:
    input:
        archive=rules.archive.output.archive,
    output:
        figures=directory(f"{OUT}/figures"),
        page=report(
            f"{OUT}/report.html", category="Report", caption="../report/report.rst"
        ),
        checksums=f"{OUT}/report.json",
    log:
        f"{OUT}/logs/report.log",
    benchmark:
        f"{OUT}/benchmarks/report.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("report"),
        runtime=minutes("report"),
    message:
        "figures and report"
    script:
        "../scripts/report.py"


rule summary:
    input:
        archive=rules.archive.output.archive,
        page=rules.report.output.page,
        export=rules.export.output.checksums,
    output:
        summary=f"{OUT}/summary.json",
    log:
        f"{OUT}/logs/summary.log",
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("report"),
        runtime=minutes("report"),
    params:
        benchmarks=f"{OUT}/benchmarks",
    message:
        "summary"
    script:
        "../scripts/summary.py"
