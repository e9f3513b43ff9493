"""Whole calibration loop in one process, for notebooks, benchmarks and tests.

The workflow executes the steps of the loop as separate jobs, which exchange files. Workflow and loop make
equal runs, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.scoring import score, score_reference
from radcal.calibration.steps import all_parameters, propose_all, reference_runs, run_all_draws, train_all, verify
from radcal.calibration.stopping import Decision, decide
from radcal.config import Case
from radcal.config.stages import STAGES
from radcal.image.model import Measurement
from radcal.objectives import make_objectives
from radcal.objectives.history import History
from radcal.proposals.design import design_points
from radcal.proposals.surrogate import Training
from radcal.radar.geometry import Geometry
from radcal.registration.geometry_check import checked
from radcal.registration.registered import Registered, register, register_again
from radcal.scene.model import Scene
from radcal.simulators.declared_scale import check_scale
from radcal.simulators.runner import Runner
from radcal.storage.runs import Parameters, Record
from radcal.targets.target import Targets
from radcal.targets.target_fit import laws_of_image


def register_rounds(
    case: Case, runners: Sequence[Runner], geometry: Geometry, measurement: Measurement, scene: Scene
) -> tuple[Registered, tuple[list[Record], Parameters] | None]:
    """Register the measured image onto the reference run and, if configured, onto the registration run.

    Parameters
    ----------
    case : Case
        Configuration of a case of one pass, whose starting parameters belong to the calibrated laws.
    runners : sequence of Runner
        Simulator of the pass with a run store.
    geometry : Geometry
        Geometry of the pass.
    measurement : Measurement
        Measured image.
    scene : Scene
        Scene of the runs.

    Returns
    -------
    registered : Registered
        Registered measured image.
    run : (list of Record, Parameters) or None
        Registration run and its X by material, for :func:`calibrate`; None if the image is registered once.

    Raises
    ------
    MeasurementError
        The measured image has nothing in common with the simulated image, or contradicts the geometry of the pass.
    """
    reference = STAGES["reference_run"].of(case)
    start = _image_db(reference_runs(reference, runners)[0][0])
    check_scale(start, measurement.image_db, reference)
    first = register(start, measurement, case.registration)
    first = checked(first, start, geometry, case.radar, scene.slope_error_deg)
    if not case.registers_twice:
        return first, None
    found = laws_of_image(STAGES["target"].of(case), geometry, first, start, scene)
    parameters = all_parameters(case.materials, found)
    records = run_all_draws(STAGES["registration_run"].of(case), runners, parameters, image=True)
    return register_again(_image_db(records[0]), first, case.registration), (records, parameters)


def _image_db(record: Record) -> NDArray[np.float32]:
    """Whole image of a run that was asked for it [dB]."""
    assert record.image_db is not None  # noqa: S101
    return record.image_db


def calibrate(
    case: Case,
    runners: Sequence[Runner],
    targets: Sequence[Targets],
    report: Callable[[History], None] = lambda _: None,
    reference: Sequence[Runner] | None = None,
    registration: tuple[list[Record], Parameters] | None = None,
) -> tuple[History, Decision]:
    """Make the reference run, the design runs, and infill runs until the search of every material has ended.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    runners : sequence of Runner
        Simulator of each pass with a run store; stored runs are not simulated again.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass, divided into incidence-angle bins if the objective needs them
        (``radcal.targets.target_fit.make_targets``).
    report : callable, optional
        Function that is called with the history after the design and after every infill run.
    reference : sequence of Runner, optional
        Simulator of each pass for the reference run, made for ``case.at_start``; needed if the starting parameters of
        a calibrated material belong to another law.
    registration : (list of Record, Parameters), optional
        Run onto whose image the measured image was registered again, and its X by material.

    Returns
    -------
    history : History
        All runs with their scores.
    decision : Decision
        Reason why the loop ended.

    Raises
    ------
    ValueError
        If the starting parameters of a calibrated material belong to another law and ``reference`` is missing.
    """
    simulation, scores = STAGES["verify"].of(case), STAGES["scores"].of(case)
    train, proposal = STAGES["train"].of(case), STAGES["propose"].of(case)
    others = case.start_with_another_law
    if others and reference is None:
        raise ValueError(f"materials {others} start with another law: expected a reference runner")
    objectives = make_objectives(scores, targets)
    made = reference_runs(STAGES["reference_run"].of(case), reference or runners)
    runs = score_reference(scores, made, targets, objectives)
    if registration is not None:
        runs.append(score("registration", 0, *registration, targets, objectives, case.seed))
    for k, parameters in enumerate(design_points(STAGES["design_chunk"].of(case), case.design_size)):
        records = run_all_draws(simulation, runners, parameters)
        runs.append(score("design", k, records, parameters, targets, objectives, case.seed))
    history, k = History(runs), 0
    trained: dict[str, Training] = {}
    report(history)
    while not (decision := decide(history, list(objectives), case.stop, case.objective)).ended:
        trainings = train_all(history, train, objectives, trained=trained)
        proposals = propose_all(trainings, objectives, history, proposal, k, case.stop)
        runs, trained = verify(proposals, targets, objectives, runners, simulation, history, k)
        history = History([*history.runs, *runs])
        report(history)
        k += 1
    return history, decision
