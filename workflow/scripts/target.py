"""Draw the target's pixels of every calibrated material at random and fit their densities."""

from radcal.assessment.reach import check_reach
from radcal.calibration.bin_target import bin_targets
from radcal.config import stages
from radcal.radar.geometry import read_geometry
from radcal.registration.height_shift import height_warnings
from radcal.registration.registered import read_registered
from radcal.scene.model import read_scene
from radcal.session.jobs import logged, progress
from radcal.storage.run_index import indexed
from radcal.targets.target import write_targets
from radcal.targets.target_fit import make_targets

with logged(snakemake.log[0], snakemake.params.case, snakemake.wildcards.at):
    case = stages.Target.model_validate(snakemake.params.case)
    reference, _ = next(indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated, image=True))
    registered = read_registered(snakemake.input.registered)
    geometry = read_geometry(snakemake.input.geometry)
    scene = read_scene(snakemake.input.scene)
    partly = bool(snakemake.wildcards.at)
    targets = make_targets(case, geometry, registered, reference.image_db, partly=partly, scene=scene)
    check_reach(case, targets)
    targets = bin_targets(case, targets, geometry, registered, scene.slope_error_deg)
    write_targets(snakemake.output.target, targets)
    for sentence in (*height_warnings(registered, geometry, scene, case.radar), *targets.sentences()):
        progress(sentence)
