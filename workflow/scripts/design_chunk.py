"""Simulate one chunk of the design."""

from radcal.calibration.design import design_points
from radcal.calibration.steps import make_runner, noise_seed
from radcal.config import Case
from radcal.files import write_json
from radcal.jobs import logged, progress

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    runner = make_runner(case, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    first = int(snakemake.wildcards.chunk) * case.design.chunk
    index = []
    for k, parameters in list(enumerate(design_points(case)))[first : first + case.design.chunk]:
        record = runner.run(parameters, noise_seed(case))
        index.append({"key": record.key, "parameters": parameters})
        progress(f"design run {k + 1} of {case.design.size}: {record.seconds:.1f} s")
    write_json(snakemake.output.index, index)
