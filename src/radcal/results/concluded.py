"""Conclusion of a calibration, and its results in one archive."""

from __future__ import annotations

from collections.abc import Sequence

from radcal.assessment.conclusion import conclude
from radcal.config import Stop, stages
from radcal.objectives import make_objectives
from radcal.objectives.history import History
from radcal.posterior.result import Image, Posterior
from radcal.radar.geometry import Geometry
from radcal.registration.height_shift import with_height_finding
from radcal.registration.registered import Registered
from radcal.results.archive import Archive
from radcal.results.results import collect_results
from radcal.results.search_front import search_fronts
from radcal.scene.model import Scene
from radcal.storage.runs import Record
from radcal.targets.target import Targets

__all__ = ["archive_of"]


def archive_of(
    case: stages.ArchiveStage,
    stop: Stop,
    history: History,
    scene: Scene,
    geometry: Geometry,
    passes: Sequence[Registered],
    targets: Targets,
    runs: str,
    final: Sequence[Record],
    posteriors: Sequence[Posterior],
    image: Image,
) -> Archive:
    """Conclude a calibration (:func:`.conclude`) and collect its results (:func:`.collect_results`).

    ``runs`` is the folder of the run store; ``posteriors`` are in the order of the calibrated materials.
    """
    images = [with_height_finding(passes[0], geometry, scene, case.radar), *passes[1:]]
    of_each = dict(zip(case.calibrated, posteriors, strict=True))
    objectives = make_objectives(case, targets)
    found = conclude(case, stop, history, targets, objectives, geometry, runs, final[:2], of_each, image, images)
    return collect_results(
        case=case, stop=stop, history=history, scene=scene, geometry=geometry, registered=images[0], targets=targets,
        conclusion=found, image=image, passes=images, final=final, fronts=search_fronts(objectives, history),
    )  # fmt: skip
