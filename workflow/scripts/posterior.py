"""Sample the posterior of the laws of all calibrated materials, given what the fixed materials say."""

from radcal.assessment.model import image_of, posterior_of
from radcal.assessment.observation import observe, simulated_of
from radcal.objectives import make_objectives
from radcal.objectives.history import read_search
from radcal.radar.geometry import read_geometry
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.session.jobs import job, progress
from radcal.storage.runs import indexed
from radcal.targets.target import Targets

with job(snakemake) as case:
    history = read_search(snakemake.input.scores, snakemake.input.verified)
    targets, scene = [Targets.read(path) for path in snakemake.input.target], Scene.read(snakemake.input.scene)
    geometries = [read_geometry(path) for path in snakemake.input.geometry]
    final = [(run, run_x) for run, run_x in indexed([snakemake.input.final], snakemake.params.runs, case.calibrated)]
    simulated = simulated_of(case, scene, geometries, final, snakemake.params.draws)
    cells = [
        observe(one, geometry, Registered.read(path), images, found.levels, scene)
        for one, geometry, path, images, found in zip(
            case.passes, geometries, snakemake.input.registered, simulated, targets, strict=True
        )
    ]
    progress("posterior: the image is compared with the fixed laws ...")
    image = image_of(case, cells)
    objectives = make_objectives(case, targets)
    for name, path in zip(case.calibrated, snakemake.output.posterior, strict=True):
        progress(f"posterior: the law of {name} is sampled ...")
        posterior_of(case, targets, history, objectives[name], cells, image).write(path)
    image.write(snakemake.output.image)
