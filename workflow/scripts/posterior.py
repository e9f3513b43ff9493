"""Sample the posterior distribution of one material's law."""

from radcal.assessment.posterior import posterior_of, write_posterior
from radcal.calibration.history import read_runs
from radcal.config import stages
from radcal.measurement.target import read_targets
from radcal.running.jobs import logged, progress

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Posterior.model_validate(snakemake.params.case)
    history = read_runs([snakemake.input.scores, *snakemake.input.verified])
    name = snakemake.wildcards.material
    targets = read_targets(*snakemake.input.target)
    posterior = posterior_of(case, targets, history, name)
    write_posterior(snakemake.output.posterior, posterior)
    said = posterior.sentence(case.uncertainty.known_db, targets.level_only(name))
    if posterior.known_between_deg is not None:
        said = f"if its law fits{' and the level of the image is right' * targets.levels.significant}, {said}"
    progress(f"{name}: {said}")
