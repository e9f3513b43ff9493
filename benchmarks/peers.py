"""Other optimisers on a problem of :mod:`searches`, each with the settings that its authors recommend.

Every method gets X and residuals of the reference run; CMA-ES and Levenberg-Marquardt take only X, as mean and as
start. Methods that take a vector of residuals get the differences of mean, log sd and skewness; the others get
the decimal logarithm of their sum of squares, which tells more than the rms far from the target. X lies in the unit
box. A method that ends by itself starts again at a Sobol point.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc
from searches import Problem

Doubles = NDArray[np.float64]
_HOUR_S = 3600.0
_DIFFERENCE = 1e-3  # step for derivatives, larger than the rounding of pixels


@dataclass(frozen=True)
class Peer:
    """Another optimiser.

    Attributes
    ----------
    search : callable
        Search, which the problem ends.
    most : int
        Largest number of runs.
    most_s : float
        Largest CPU time of a search, without the simulator [s].
    """

    search: Callable[[Problem], str]
    most: int = 1200
    most_s: float = _HOUR_S


def _sobol(problem: Problem) -> Iterator[Doubles]:
    """Scrambled Sobol points, without end."""
    sampler = qmc.Sobol(problem.dimension, rng=problem.seed)
    while True:
        yield from sampler.random(16)


def _starts(problem: Problem) -> Iterator[Doubles]:
    """X of the reference run, and then Sobol points."""
    return chain([problem.start], _sobol(problem))


def _scalar(residuals: Doubles) -> float:
    return float(np.log10(max(np.sum(residuals**2), 1e-30)))


def cma_es(problem: Problem) -> str:
    """BIPOP-CMA-ES of cma, from the reference run and then from Sobol points, first step a quarter of the box."""
    import cma

    restarts = {"restarts": 9, "bipop": True}
    options = {"bounds": [0.0, 1.0], "seed": problem.seed % 2**31 + 1, "verbose": -9}
    starts = _starts(problem)
    while True:
        cma.fmin2(
            lambda unit: _scalar(problem.residuals(np.asarray(unit))), lambda: next(starts), 0.25, options, **restarts
        )


def levenberg_marquardt(problem: Problem) -> str:
    """MINPACK's Levenberg-Marquardt by scipy, from the reference run and then from Sobol points.

    X = sin(v)^2 keeps it in the box, as MINUIT does. MINPACK wants as many residuals as parameters: the last one is 0.
    """
    starts = _starts(problem)
    while True:
        inside = np.clip(next(starts), 0.02, 0.98)  # at a bound, the residuals do not change with v

        def residuals(v: Doubles) -> Doubles:
            found = problem.residuals(np.sin(v) ** 2)
            return np.append(found, np.zeros(len(v) - len(found)))

        least_squares(residuals, np.arcsin(np.sqrt(inside)), method="lm", diff_step=_DIFFERENCE)


def _trust_region(method: str, problem: Problem) -> str:
    """Trust region of scipy within the bounds, from the reference run and then from Sobol points."""
    starts = _starts(problem)
    while True:
        least_squares(problem.residuals, next(starts), bounds=(0.0, 1.0), method=method, diff_step=_DIFFERENCE)


# parameters are X + 1, because the program limits their relative changes
_PEST = """pcf
* control data
restart estimation
{d} {n} 1 0 1
1 1 double point
10.0 -3.0 0.3 0.01 10
10.0 10.0 0.001
0.1
50 0.005 4 4 0.005 4
0 0 0
* parameter groups
x absolute 0.001 0.0 switch 2.0 parabolic
* parameter data
{parameters}
* observation groups
residuals
* observation data
{observations}
* model command line
sh run.sh
* model input/output
x.tpl x.txt
found.ins found.txt
++ uncertainty(false)
"""


def _write_pest(folder: Path, unit: Doubles, n: int) -> None:
    """Write a case of PEST++ whose model asks for the residuals, and waits for the answer."""
    parameters = "\n".join(f"x{k} none factor {x + 1.0:.15f} 1.0 2.0 x 1.0 -1.0 1" for k, x in enumerate(unit))
    observations = "\n".join(f"r{k} 0.0 1.0 residuals" for k in range(n))
    texts = {
        "case.pst": _PEST.format(d=len(unit), n=n, parameters=parameters, observations=observations),
        "x.tpl": "ptf ~\n" + "".join(f"~ x{k} {'~':>22}\n" for k in range(len(unit))),
        "found.ins": "pif ~\n" + "".join(f"l1 !r{k}!\n" for k in range(n)),
        # ends with the folder, if a search ends within a run
        "run.sh": "touch asked; until [ -e answered ]; do [ -e x.tpl ] || exit; sleep 0.005; done; rm answered\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)


def pestpp_glm(problem: Problem) -> str:
    """``pestpp-glm`` of PEST++ on the PATH with its defaults, from the reference run and then from Sobol points."""
    starts = _starts(problem)
    while True:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _write_pest(folder, next(starts), len(problem.start_residuals))
            with subprocess.Popen(["pestpp-glm", "case.pst"], cwd=folder, stdout=subprocess.DEVNULL) as program:
                try:
                    while program.poll() is None:
                        if not (folder / "asked").exists():
                            time.sleep(0.002)
                            continue
                        (folder / "asked").unlink()
                        found = problem.residuals(np.loadtxt(folder / "x.txt"))
                        np.savetxt(folder / "found.txt", found, fmt="%.16e")
                        (folder / "answered").touch()
                finally:
                    program.kill()


def _known(problem: Problem, count: int) -> tuple[list[Doubles], list[Doubles]]:
    """X and residuals of the reference run and of Sobol points."""
    units = [unit for unit, _ in zip(_sobol(problem), range(count), strict=False)]
    return [problem.start, *units], [problem.start_residuals, *map(problem.residuals, units)]


def ego(problem: Problem) -> str:
    """EGO of egobox with its defaults: 5 first runs, kriging, logarithmic expected improvement."""
    import egobox

    units, found = _known(problem, problem.dimension + 1)
    costs = [_scalar(one) for one in found]
    optimiser = egobox.Egor([[0.0, 1.0]] * problem.dimension, seed=problem.seed)
    while True:
        (unit,) = optimiser.suggest(np.array(units), np.array(costs)[:, None])
        costs.append(_scalar(problem.residuals(unit)))
        units.append(unit)


def _optuna(problem: Problem, gaussian: bool) -> str:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    if gaussian:
        sampler = optuna.samplers.GPSampler(seed=problem.seed, deterministic_objective=True)
    else:
        sampler = optuna.samplers.TPESampler(seed=problem.seed, multivariate=True)
    study = optuna.create_study(sampler=sampler)
    space = {f"x{k}": optuna.distributions.FloatDistribution(0.0, 1.0) for k in range(problem.dimension)}
    study.enqueue_trial(dict(zip(space, problem.start.tolist(), strict=True)))
    while True:
        trial = study.ask(space)
        study.tell(trial, _scalar(problem.residuals(np.array([trial.params[name] for name in space]))))


def optuna_tpe(problem: Problem) -> str:
    """Multivariate tree-structured Parzen estimator of Optuna."""
    return _optuna(problem, gaussian=False)


def optuna_gp(problem: Problem) -> str:
    """Gaussian process of Optuna, for a deterministic objective."""
    return _optuna(problem, gaussian=True)


def botorch(problem: Problem) -> str:
    """BoTorch with a composite objective: a Gaussian process for each residual, and qLogEI of the sum of squares."""
    import torch
    from botorch.acquisition import qLogExpectedImprovement
    from botorch.acquisition.objective import GenericMCObjective
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from botorch.optim import optimize_acqf
    from gpytorch.mlls import ExactMarginalLogLikelihood
    from gpytorch.settings import min_fixed_noise

    torch.set_num_threads(1)
    torch.manual_seed(problem.seed)
    units, found = _known(problem, 2 * (problem.dimension + 1))
    objective = GenericMCObjective(lambda samples, X=None: -(samples**2).sum(-1))  # noqa: ARG005
    box = torch.tensor([[0.0], [1.0]], dtype=torch.float64).repeat(1, problem.dimension)
    while True:
        x, y = torch.tensor(np.array(units)), torch.tensor(np.array(found))
        with min_fixed_noise(double_value=1e-10):  # runs repeat, up to the rounding of their pixels
            model = SingleTaskGP(x, y, torch.full_like(y, 1e-9))
            fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
            acquisition = qLogExpectedImprovement(model, best_f=objective(y).max(), objective=objective)
            unit, _ = optimize_acqf(acquisition, box, q=1, num_restarts=10, raw_samples=512)
        units.append(unit[0].numpy())
        found.append(problem.residuals(units[-1]))


def sbi(problem: Problem) -> str:
    """Neural posterior estimation of sbi by 100 runs in the box, and one run at the posterior's mode."""
    import torch
    from sbi.inference import NPE
    from sbi.utils import BoxUniform

    torch.set_num_threads(1)
    torch.manual_seed(problem.seed)
    prior = BoxUniform(torch.zeros(problem.dimension), torch.ones(problem.dimension))
    units = [problem.start, *prior.sample((100,)).numpy().astype(float)]
    found = [problem.residuals(unit) for unit in units]
    network = NPE(prior, show_progress_bars=False)
    of_runs = (torch.tensor(np.array(one), dtype=torch.float32) for one in (units, found))
    network.append_simulations(*of_runs).train()
    posterior = network.build_posterior().set_default_x(torch.zeros(1, len(found[0])))
    mode = posterior.map(show_progress_bars=False).numpy().ravel()
    problem.residuals(mode.astype(float))
    return "one verifying run"


PEERS = {
    "cma_es": Peer(cma_es),
    "levenberg_marquardt": Peer(levenberg_marquardt),
    "trf": Peer(partial(_trust_region, "trf")),
    "dogbox": Peer(partial(_trust_region, "dogbox")),
    "pestpp_glm": Peer(pestpp_glm),
    "optuna": Peer(optuna_tpe),
    "optuna_gp": Peer(optuna_gp, 300),
    "ego": Peer(ego, 300),
    "botorch": Peer(botorch, 300),
    "sbi": Peer(sbi),
}
