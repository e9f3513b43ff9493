"""Make the target of every calibrated material: pixels drawn at random, their density and incidence-angle bins."""

from radcal.objectives import objective_class
from radcal.radar.geometry import read_geometry
from radcal.registration.height_shift import with_height_finding
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.storage.runs import indexed
from radcal.targets.target_fit import make_targets
from radcal.words import sentence

with job(snakemake) as case:
    reference, _ = next(indexed([snakemake.input.reference], snakemake.params.runs, case.calibrated, image=True))
    registered = Registered.read(snakemake.input.registered)
    geometry = read_geometry(snakemake.input.geometry)
    scene = Scene.read(snakemake.input.scene)
    misfit, partly = objective_class(case.objective).misfit, snakemake.wildcards.p != "1"
    targets = make_targets(case, geometry, registered, reference.image_db, misfit, partly, scene)
    targets.write(snakemake.output.target)
    found = with_height_finding(registered, geometry, scene, case.radar).measurement.findings
    for text in (*[sentence(one) for one in found if one.code == "height_shift"], *targets.sentences()):
        progress(text)
