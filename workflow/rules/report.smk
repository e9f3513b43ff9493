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
        image=f"{OUT}/image.h5",
        posterior=expand(f"{OUT}/posterior/{{material}}.h5", material=CASE.calibrated),
    log:
        f"{OUT}/logs/posterior.log",
    benchmark:
        f"{OUT}/benchmarks/posterior.tsv"
    retries: 0
    threads: 1
    resources:
        mem_mb=memory("run"),
        runtime=minutes("run", 2 * len(PASSES)),
    params:
        case=STAGES["posterior"].params(CASE),
        runs=f"{OUT}/runs",
        draws=f"{OUT}/posterior/draws",
    message:
        "posterior of all laws"
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
        image=rules.posterior.output.image,
        posterior=rules.posterior.output.posterior,
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
