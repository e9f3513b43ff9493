"""Draw the pixels of every calibrated material and fit their densities."""

from radcal.config import Case
from radcal.jobs import logged, progress
from radcal.measurement.registration import read_registered
from radcal.measurement.target import make_target, write_targets
from radcal.radar.geometry import read_geometry

with logged(snakemake.log[0]):
    case = Case.of_sections(snakemake.params.case)
    geometry = read_geometry(snakemake.input.geometry)
    registered = read_registered(snakemake.input.registered)
    measured = registered.measurement, case.target, case.seed, registered.uncertainty_px
    targets = {name: make_target(name, geometry, *measured) for name in case.calibrated}
    write_targets(snakemake.output.target, targets)
    for name, target in targets.items():
        mean, sd, skewness = target.cp
        progress(f"target of {name}: {len(target.pixels)} pixels, {mean:.2f} +- {sd:.2f} dB, skewness {skewness:.2f}")
