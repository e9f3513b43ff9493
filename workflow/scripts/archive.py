"""Write every run and iteration to one file, ``calibration.h5``, and all runs to one table, ``runs.csv``."""

from radcal.assessment.conclusion import conclude
from radcal.assessment.posterior import Image, Posterior
from radcal.calibration.history import read_runs
from radcal.config import Stop, stages
from radcal.measurement.height_shift import with_height_warning
from radcal.measurement.registration import read_registered
from radcal.measurement.target import read_targets
from radcal.radar.geometry import read_geometry
from radcal.report.archive import write_archive
from radcal.report.results import gather
from radcal.report.run_table import write_table
from radcal.running.jobs import logged
from radcal.scene.model import read_scene
from radcal.storage.listing import write_listing
from radcal.storage.records import read_item, read_json, understood
from radcal.storage.run_index import indexed

with logged(snakemake.log[0], snakemake.params.case):
    case = stages.Archive.model_validate(snakemake.params.case)
    with understood(snakemake.input.stop):
        stop = Stop.model_validate(read_json(snakemake.input.stop))
    history = read_runs([snakemake.input.scores, *snakemake.input.verified])
    targets, geometry = read_targets(*snakemake.input.target), read_geometry(snakemake.input.geometry[0])
    runs = snakemake.params.runs
    final = [record for record, _ in indexed([snakemake.input.final], runs, case.calibrated)]
    images = [read_registered(path) for path in snakemake.input.registered]
    each = [read_item(path, "posterior", Posterior) for path in snakemake.input.posterior]
    posteriors = dict(zip(case.calibrated, each, strict=True))
    image = read_item(snakemake.input.image, "image", Image)
    scene = read_scene(snakemake.input.scene)
    images[0] = with_height_warning(images[0], geometry, scene, case.radar)
    found = conclude(case, stop, history, targets, geometry, runs, final[:2], posteriors, image, images)
    archive = gather(
        case=case, stop=stop, history=history, scene=scene, geometry=geometry, registered=images[0], targets=targets,
        conclusion=found, image=image, passes=images, final=final,
    )  # fmt: skip
    write_archive(snakemake.output.archive, archive)
    write_table(snakemake.output.table, archive)
    write_listing(snakemake.output.checksum, [snakemake.output.table])
