"""Calibration of twins: synthetic measured images with a known hidden law and settings unlike the simulator's.

    python benchmarks/twins.py [--quick] [--seeds 20] [--first-seed 0] [--factors none,relief] [--jobs 2] [--out FILE]

A twin is the default case with a hidden law drawn for each seed, uniformly in the bounds of the calibrated material.
The measured image of a twin is made with settings that the simulator does not know (``docs/twins.md``), is written to a
GeoTIFF and is read as any measured file. Each mismatch with the simulator is a factor. The twins have a single factor
(``--seeds`` twins for each), no factor (``none``, twice as many twins) or all factors (``all``, three times as many).
The image covers a part of the scene, so that a twin takes seconds.

Each finished twin is one line of the file ``--out`` and is not made again. After a change of radcal, name another file
with ``--out``. The last line printed is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from twin_images import FACTORS, UNDISTURBED, Curve, bench, carrier, darkest_db, hidden_law

from radcal.assessment.conclusion import conclude
from radcal.assessment.posterior import posterior_of
from radcal.assessment.verdict import first_line
from radcal.calibration.bin_target import bin_targets
from radcal.calibration.history import History
from radcal.calibration.loop import calibrate, register_rounds
from radcal.calibration.steps import all_parameters, noise_seed
from radcal.config import Case, case_from, stages
from radcal.errors import RadcalError
from radcal.measurement.registration import Registered
from radcal.measurement.sources import make_measurement
from radcal.measurement.target import Targets
from radcal.measurement.target_fit import make_targets
from radcal.radar.laws import seen_rad
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

ANGLES = 19  # between the 5 % and 95 % quantiles of the incidence
SILENT_DB = 2.0
WIDE_DEG = 5.0
WALKERS = 64  # half of the default: enough for the tests of convergence, in half of the time
WARNINGS = ("which can hide", "at no angle", "in doubt", "has not met")  # in a first line that says "fits"
MORE = {"none": 2, "all": 3}  # times as many seeds


def write_tif(path: Path, image_db: NDArray[np.float32]) -> None:
    """Write an image in power as a GeoTIFF without a georeference."""
    import rasterio

    height, width = image_db.shape
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an image in slant range has no georeference
        with rasterio.open(
            path, "w", driver="GTiff", height=height, width=width, count=1, dtype="float32", nodata=np.nan
        ) as file:
            file.write(10.0 ** (image_db / 10.0), 1)


def twin(factor: str, seed: int) -> dict[str, Any]:
    """One finished twin: its sizes, the hidden law, and what its calibration says."""
    began, b = time.time(), bench()
    sizes = FACTORS[factor](derived_rng(seed, "twins", factor))
    row: dict[str, Any] = {"factor": factor, "seed": seed, "sizes": dict(sizes)}
    hidden, curve = hidden_law(seed, sizes)
    if (below := sizes.pop("noise_below_db", None)) is not None:
        sizes["nesz_db"] = darkest_db(curve) - below
    synthetic = {**UNDISTURBED, **sizes, **hidden, "seed": int(derived_rng(seed, "twins", "image").integers(2**31))}
    try:
        made = case_from({"measurement": {"source": "synthetic", "synthetic": synthetic}, **carrier(b.case)})
        simulator = BuiltinSimulator(b.geometry, made.radar, made.laws)
        image = make_measurement(stages.Measurement.of(made), b.geometry, simulator, b.scene)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "image.tif"
            write_tif(path, image.image_db)
            measured = {
                "source": "file", "path": str(path), "scale": "power", "radiometry": made.radar.radiometry,
            }  # fmt: skip
            case = case_from({"measurement": measured, "uncertainty": {"walkers": WALKERS}, **carrier(b.case)})
            row |= calibrated(case, simulator, Path(folder), curve)
    except RadcalError as error:
        row |= {"refused": str(error)}
    return row | {"seconds": round(time.time() - began, 2)}


def calibrated(case: Case, simulator: BuiltinSimulator, folder: Path, curve: Curve) -> dict[str, Any]:
    """Calibration of a case whose measured image is a file, and what it says of the law."""
    b = bench()
    runner = Runner(RunStore(folder), simulator, b.geometry, b.scene.identity, stages.Simulation.of(case))
    measurement = make_measurement(stages.Measurement.of(case), b.geometry, simulator, b.scene)
    registered, run = register_rounds(case, runner, b.geometry, measurement, b.scene)
    stage = stages.Target.of(case)
    start = runner.run(case.start_parameters, noise_seed(case), image=True).image_db
    targets = make_targets(stage, b.geometry, registered, start, scene=b.scene)
    targets = bin_targets(stage, targets, b.geometry, registered, b.scene.slope_error_deg)
    history, decision = calibrate(case, runner, targets, registration=run)
    phi = np.linspace(*seen_rad(targets[b.material].incidence_deg)[[0, -1]], ANGLES)
    return {
        "runs": len(history.runs),
        "ended": str(decision.reason),
        "angles_deg": np.degrees(phi).tolist(),
        "truth_db": np.asarray(curve(phi)).tolist(),
        **stated(case, runner, targets, history, phi, folder, registered),
        "notes": list(measurement.notes),
    }


def stated(
    case: Case,
    runner: Runner,
    targets: Targets,
    history: History,
    phi: NDArray[np.float64],
    folder: Path,
    registered: Registered,
) -> dict[str, Any]:
    """Curve and 90 % band at angles [rad], where it is called known, whether it fits, and the first line."""
    name, angles = bench().material, np.degrees(phi)
    posterior = posterior_of(stages.Posterior.of(case), targets, history, name)
    score = history.best(name).scores[name]
    parameters = all_parameters(case.materials, {name: score.parameters})
    final = [runner.run(parameters, noise_seed(case, fresh), image=fresh) for fresh in (False, True)]
    archive = stages.Archive.of(case)
    found = conclude(
        archive, case.stop, history, targets, bench().geometry, folder, final, {name: posterior}, registered
    )  # fmt: skip
    line = first_line(found.verdicts, {name: found.fits[name].fits}, found.decision.converged)
    low, high = posterior.known_between_deg or (np.inf, -np.inf)
    curve = posterior.curve
    assert curve is not None
    bands = {
        key: np.interp(angles, curve.incidence_deg, getattr(curve, key)).tolist()
        for key in ("median_db", "p05_db", "p95_db")
    }
    return {
        "parameters": list(score.parameters), "looks": score.looks, "fits": found.fits[name].fits, **bands,
        "p": found.fits[name].p, "known": ((angles >= low) & (angles <= high)).tolist(), "line": line,
        "warned": not line.startswith(f"{name} fits") or any(words in line for words in WARNINGS),
        "sampled": posterior.sampled, "between_db": posterior.between_db[1],
        "incidence_error_deg": found.checks[name].incidence_error_deg, "remarks": found.notes,
    }  # fmt: skip


def single_threaded(job: tuple[str, int]) -> dict[str, Any]:
    """One twin on one core."""
    import numba
    from threadpoolctl import threadpool_limits

    numba.config.NUMBA_NUM_THREADS = 1
    with threadpool_limits(1):
        return twin(*job)


def finished(path: Path) -> list[dict[str, Any]]:
    """Twins of a file; a last line that a kill has cut is left out and ended."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    rows = []
    for line in text.splitlines():
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    if text and not text.endswith("\n"):
        with path.open("a", encoding="utf-8") as file:
            file.write("\n")
    return rows


def make(jobs: list[tuple[str, int]], processes: int) -> Iterable[dict[str, Any]]:
    """Twins as they are finished, in order."""
    if processes == 1:
        yield from map(single_threaded, jobs)
        return
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(single_threaded, jobs)


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures of some twins; a refused one is announced, knows nothing and fits nothing."""
    found = [row for row in rows if "median_db" in row]
    known = [np.array(row["known"], dtype=bool) for row in found]
    error = [np.array(row["median_db"]) - row["truth_db"] for row in found]
    half = [(np.array(row["p95_db"]) - row["p05_db"]) / 2.0 for row in found]
    inside = [
        (np.array(row["p05_db"]) <= row["truth_db"]) & (np.array(row["truth_db"]) <= row["p95_db"]) for row in found
    ]
    silent = [
        not row["warned"] and bool((k & ~i & (np.abs(e) > SILENT_DB)).any())
        for row, k, i, e in zip(found, known, inside, error, strict=True)
    ]
    wide = [span(row, k) >= WIDE_DEG for row, k in zip(found, known, strict=True)]
    n = len(rows)
    tests = [row["fits"] for row in found if row["fits"] is not None]
    return {
        "n": n,
        "refused": n - len(found),
        "coverage_90": pooled(inside, known, np.mean),
        "silent": sum(silent),
        "fit": float(np.mean(tests)) if tests else None,
        "warned": (sum(bool(row["warned"]) for row in found) + n - len(found)) / n if n else None,
        "known_5_deg": sum(wide) / n if n else None,
        "half_width_db": pooled(half, known, np.median),
        "error_db": pooled([np.abs(e) for e in error], known, np.median),
        "largest_db": float(np.median([np.abs(e).max() for e in error])) if error else None,
        "bias_db": [round(float(np.mean([e[k] for e in error])), 2) for k in (0, ANGLES // 2, -1)] if error else None,
    }


def pooled(values: list[Any], masks: list[Any], of: Callable[[Any], Any]) -> float | None:
    """Figure of all values at known angles of all twins."""
    all_values = np.concatenate([v[m] for v, m in zip(values, masks, strict=True)]) if values else np.empty(0)
    return float(of(all_values)) if all_values.size else None


def span(row: dict[str, Any], known: NDArray[np.bool_]) -> float:
    """Widest range of incidence that is known without a gap [deg]."""
    angles, best, first = row["angles_deg"], 0.0, None
    for angle, told in zip(angles, known, strict=True):
        first = (angle if first is None else first) if told else None
        if first is not None:
            best = max(best, angle - first)
    return best


def table(rows: list[dict[str, Any]], factors: list[str]) -> dict[str, Any]:
    """Print the figures of each factor, and give them."""
    print(
        f"\n{'factor':13} {'n':>3} {'refused':>7} {'coverage':>8} {'silent':>6} {'fit':>5} {'warned':>6} {'known':>6} "
        f"{'half width':>10} {'error':>6} {'largest':>7}  bias at 5 %, middle, 95 % of the incidence"
    )
    every = {}
    for factor in factors:
        every[factor] = f = figures([row for row in rows if row["factor"] == factor])
        cells = [f["coverage_90"], f["fit"], f["warned"], f["known_5_deg"], f["half_width_db"], f["error_db"]]
        c, fit, warned, known, half, error = ("-" if v is None else f"{v:.2f}" for v in cells)
        largest = "-" if f["largest_db"] is None else f"{f['largest_db']:.2f}"
        print(
            f"{factor:13} {f['n']:3d} {f['refused']:7d} {c:>8} {f['silent']:6d} {fit:>5} {warned:>6} {known:>6} "
            f"{half:>10} {error:>6} {largest:>7}  {f['bias_db']}"
        )
    return every


def main() -> None:
    """Make the twins that are missing, print the table and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 seed of each factor in place of 20")
    parser.add_argument("--seeds", type=int, default=20, help="twins of each factor")
    parser.add_argument("--first-seed", type=int, default=0, help="number of the first seed")
    parser.add_argument("--factors", default=",".join(FACTORS), help="which, with commas")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/twins.jsonl"), help="file of finished twins")
    a = parser.parse_args()
    factors, first = a.factors.split(","), a.first_seed
    if unknown := set(factors) - set(FACTORS):
        parser.error(f"--factors: {', '.join(sorted(unknown))}, expected some of {', '.join(FACTORS)}")
    times = {factor: 1 if a.quick else MORE.get(factor, 1) for factor in factors}
    # in turn, so that an unfinished file has all factors in their shares
    wanted = [
        (factor, first + n * turn + k)
        for turn in range(1 if a.quick else a.seeds)
        for factor, n in times.items()
        for k in range(n)
    ]
    a.out.parent.mkdir(parents=True, exist_ok=True)
    rows = {(row["factor"], row["seed"]): row for row in finished(a.out)}
    missing = [job for job in wanted if job not in rows]
    with a.out.open("a", encoding="utf-8") as file:
        for row in make(missing, a.jobs):
            rows[row["factor"], row["seed"]] = row
            file.write(json.dumps(row) + "\n")
            file.flush()
            os.fsync(file.fileno())
            said = row.get("line") or row.get("refused") or row["ended"]
            print(f"{row['factor']:13} {row['seed']:3d} {row['seconds']:6.1f} s  {said}", flush=True)
    made = [rows[job] for job in wanted]
    every = table(made, factors)
    print(json.dumps({**figures(made), "factors": every}))


if __name__ == "__main__":
    main()
