"""Simulate the starting parameters: one run that shows whether everything is wired."""

from radcal.calibration.steps import make_runner, noise_seed, reference_parameters
from radcal.config import Case
from radcal.files import write_json
from radcal.jobs import logged, progress

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    runner = make_runner(case.at_start, snakemake.input.scene, snakemake.input.geometry, snakemake.params.runs)
    parameters = reference_parameters(case)
    record = runner.run(parameters, noise_seed(case), image=True)
    write_json(snakemake.output.index, [{"key": record.key, "parameters": parameters}])
    progress(f"reference run: {record.seconds:.1f} s for {record.image_db.shape} pixels")
