"""Draw the pixels of every calibrated material and fit their densities."""

from radcal.calibration.history import indexed
from radcal.config import Case
from radcal.jobs import logged, progress
from radcal.measurement.registration import read_registered
from radcal.measurement.target import make_targets, write_targets
from radcal.radar.geometry import read_geometry

with logged(snakemake.log[0], snakemake.params.case):
    case = Case.of_sections(snakemake.params.case)
    reference, _ = next(indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated, image=True))
    registered = read_registered(snakemake.input.registered)
    targets = make_targets(case, read_geometry(snakemake.input.geometry), registered, reference.image_db)
    write_targets(snakemake.output.target, targets)
    for sentence in targets.sentences():
        progress(sentence)
