"""Test of ``radcal advise``: how often the advised pass is the one that narrows the 90 % band of sigma0 most.

    python benchmarks/advice.py [--quick] [--truths 10] [--first 0] [--speckle 0] [--protocol drawn] [--out FILE]

The question of each test is that of a user who needs the law of the default case's dyke over an interval of incidence,
has one pass, and can have one of three further passes. A generator with a fixed seed for each number draws

- the hidden law, uniformly in the bounds of the dyke;
- the first pass, one of six: depression angles of 30, 45 and 60 degrees, each to the right and to the left;
- 100 questions: three of the five other passes as candidates, and an interval of interest, whose width is uniform
  between 20 and 30 degrees, and whose place is uniform in the incidence of the dyke (from the lowest 5 % quantile to
  the highest 95 % quantile of the six passes).

The law is measured in the first pass, with independent speckle and no other mismatch, and is calibrated. Of the
questions, the first one is followed for which ``radcal advise`` would name one pass alone: this pass is expected to
narrow the band by a tenth, and no other candidate is as good within 5 %. The expected half-widths alone decide this. A
number without such a question is skipped. Each candidate is then measured, and calibrated together with the first pass.
The advice is right if the advised pass leaves the smallest half-width of the 90 % band of sigma0, averaged over the
interval. The half-widths found are those of the posterior's whole sample, because quantiles of its 400 kept draws
differ by up to a fifth.

Peers that know geometry and interval, and no posterior: the largest share of the dyke's usable pixels inside of the
interval (``inside``); the median incidence nearest to the interval's middle (``median``); the largest part of the
interval between the 5 % and 95 % quantiles of the incidence in the first or the further pass, and at equal parts the
largest share (``covered``). Peers without a choice: a random pass, and always the same pass.

``--protocol contested`` follows, of 1000 questions, the first one for which ``radcal advise`` would name one pass alone
and ``inside`` names another one. ``--protocol fixed`` has the same passes for each hidden law (45 degrees right; then
30 right, 60 right or 45 left), the whole incidence as interval, and follows each number. ``--speckle`` draws other
speckle for the further passes.

Each finished number is one line of the file ``--out`` and is not made again. The last line printed is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from passes import calibrated_passes
from twins import finished

from radcal.assessment.model import image_of, posterior_of
from radcal.assessment.observation import observe
from radcal.assessment.preposterior import View, half_widths_after, half_widths_now, view_of
from radcal.config import Case, case_from
from radcal.config.stages import STAGES
from radcal.objectives import make_objectives
from radcal.posterior.cells import Simulated
from radcal.posterior.curves import GRID_DEG
from radcal.posterior.result import Posterior
from radcal.processes import one_thread
from radcal.products.advice import advice_on, judged
from radcal.radar.geometry import Geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng
from radcal.simulators.builtin import BuiltinSimulator

NAME = "dyke"
PASSES = [(depression, side) for depression in (30.0, 45.0, 60.0) for side in ("right", "left")]
FIXED = [(45.0, "right"), (30.0, "right"), (60.0, "right"), (45.0, "left")]
PEERS = ("inside", "median", "covered")
WIDTH_DEG = (20.0, 30.0)
QUESTIONS = {"drawn": 100, "contested": 1000}  # for each hidden law
ALONE = "one pass alone"
LOOKS, SEED = 32.0, 9  # of the simulated image with which the cells are compared, as in the workflow

Doubles = NDArray[np.float64]
Pass = tuple[float, str]


@dataclass(frozen=True)
class Ground:
    """Scene of the default case, and what each pass sees of it: geometry, and usable pixels of the dyke."""

    scene: Scene
    geometries: dict[Pass, Geometry]
    views: dict[Pass, View]

    @classmethod
    def made(cls, case: Case) -> Ground:
        """Scene, and what all passes see of it."""
        scene = make_scene(case.scene, list(case.materials))
        radars = {one: case.radar.model_copy(update=settings(one)) for one in PASSES}
        geometries = {one: make_geometry(scene, radar) for one, radar in radars.items()}
        views = {one: view_of(NAME, geometries[one], radars[one], case.target.margin_px, scene) for one in PASSES}
        return cls(scene, geometries, {one: view for one, view in views.items() if view is not None})

    def seen_deg(self, one: Pass) -> tuple[float, float]:
        """5 % and 95 % quantiles of the incidence in a pass [deg]."""
        low, high = np.quantile(self.views[one].incidence_deg, [0.05, 0.95])
        return float(low), float(high)


@dataclass(frozen=True)
class Question:
    """Candidates, and interval of interest [deg]; without an interval, the default one of ``radcal advise``."""

    candidates: list[Pass]
    over_deg: tuple[float, float] | None


def main() -> None:
    """Make the numbers that are missing, print a line for each and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 truth in place of 10")
    parser.add_argument("--truths", type=int, default=10, help="number of truths that are not skipped")
    parser.add_argument("--first", type=int, default=0, help="number of the first truth")
    parser.add_argument("--speckle", type=int, default=0, help="number of the draw of speckle of the further passes")
    parser.add_argument(
        "--protocol", choices=("drawn", "contested", "fixed"), default="drawn", help="how questions are made"
    )
    parser.add_argument("--out", type=Path, default=Path("results/advice.jsonl"), help="file of finished numbers")
    a = parser.parse_args()
    a.out.parent.mkdir(parents=True, exist_ok=True)
    made = {(row["protocol"], row["number"], row["speckle"]): row for row in finished(a.out)}
    base = case_of([-24.0, 10.0, 14.0, 5.0], 0, PASSES[:1])
    ground = Ground.made(base)
    rows: list[dict[str, Any]] = []
    number = a.first
    while sum("found_db" in row for row in rows) < (1 if a.quick else a.truths):
        key = (a.protocol, number, a.speckle)
        if key not in made:
            began = time.time()
            with one_thread():
                row = followed(number, base, ground, a.speckle, a.protocol)
            named = dict(zip(("protocol", "number", "speckle"), key, strict=True))
            made[key] = {**named, **row, "seconds": round(time.time() - began, 1)}
            with a.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(made[key]) + "\n")
                file.flush()
                os.fsync(file.fileno())
        rows.append(made[key])
        print(line(made[key]), flush=True)
        number += 1
    print(json.dumps(summary(rows)))


def settings(one: Pass) -> dict[str, Any]:
    """Keys of section ``radar``."""
    return {"depression_deg": one[0], "look_side": one[1]}


def drawn(protocol: str, number: int, base: Case, ground: Ground) -> tuple[list[float], Pass, list[Question]]:
    """Hidden law, first pass and questions of a number, drawn before any result is known."""
    low, high = np.array(base.materials[NAME].box).T
    if protocol == "fixed":
        truth = derived_rng(1, "benchmark", "advice").random((number + 1, len(low)))[number]
        return (low + truth * (high - low)).tolist(), FIXED[0], [Question(FIXED[1:], None)]
    rng = derived_rng(1, "benchmark", "advice", "questions", number)
    truth = low + rng.random(len(low)) * (high - low)
    first = PASSES[int(rng.integers(len(PASSES)))]
    others = [one for one in PASSES if one != first]
    seen = [ground.seen_deg(one) for one in PASSES]
    lowest, highest = min(each[0] for each in seen), max(each[1] for each in seen)
    questions = []
    for _ in range(QUESTIONS[protocol]):
        three = [others[k] for k in rng.permutation(len(others))[:3]]
        width = float(rng.uniform(*WIDTH_DEG))
        begin = float(rng.uniform(lowest, highest - width))
        questions.append(Question(three, (begin, begin + width)))
    return truth.tolist(), first, questions


def case_of(truth: list[float], number: int, passes: list[Pass], speckle: int = 0) -> Case:
    """Default case with a hidden law, and these passes; ``speckle`` numbers the draws of the further pass's speckle."""
    seeds = [100 + 10 * number + k + 1000 * speckle * (k > 0) for k in range(len(passes))]
    images = [
        {"source": "synthetic", "synthetic": {"parameters": {NAME: truth}, "seed": seed, "warp_px": 0}}
        for seed in seeds
    ]
    radar = [settings(one) for one in passes]
    return case_from({"radar": radar, "measurement": images, "registration": {"method": "none"}})


def followed(number: int, base: Case, ground: Ground, speckle: int, protocol: str) -> dict[str, Any]:
    """Mean half-widths [dB] after the first pass, and after each further one as expected and, if followed, as found."""
    truth, first, questions = drawn(protocol, number, base, ground)
    with tempfile.TemporaryDirectory() as folder:
        case = case_of(truth, number, [first])
        before = calibrated(case, ground, [first], Path(folder))
        assert before.draws is not None
        row: dict[str, Any] = {"truth": truth, "first": first}
        if protocol != "fixed":
            told = outcomes(before, case, first, questions, ground)
            row |= counted(told)
            wanted = [one.alone and not (protocol == "contested" and one.peers[PEERS[0]] == one.best) for one in told]
            if not any(wanted):
                return row
            row["tried"] = wanted.index(True) + 1
        asked = questions[row.get("tried", 1) - 1]
        radars = [case.radar.model_copy(update=settings(one)) for one in asked.candidates]
        each = advice_on(case, ground.scene, {NAME: (before, case.laws[NAME])}, radars, asked.over_deg)
        advised = [one for (one,) in each]
        over = advised[0].over_deg
        after = {(one.radar.depression_deg, one.radar.look_side): one.after_db for one in advised}
        expected = [after[one] for one in asked.candidates]
        assert protocol == "fixed" or said(advised[0].now_db, expected) == ALONE
        found = []
        for one in asked.candidates:
            narrowed = calibrated(case_of(truth, number, [first, one], speckle), ground, [first, one], Path(folder))
            found.append(half_width_db(narrowed, over))
    return {
        **row,
        "candidates": [list(one) for one in asked.candidates],
        "over_deg": over,
        "peers": peers(asked, first, over, ground),
        "advice_now_db": advised[0].now_db,
        "now_db": half_width_db(before, over),
        "expected_db": expected,
        "found_db": found,
    }


@dataclass(frozen=True)
class Outcome:
    """What ``radcal advise`` would say to a question, and indices of the passes that it and the peers put first."""

    said: str
    best: int
    peers: dict[str, int]

    @property
    def alone(self) -> bool:
        """Whether one pass alone would be named."""
        return self.said == ALONE


def outcomes(before: Posterior, case: Case, first: Pass, questions: list[Question], ground: Ground) -> list[Outcome]:
    """Outcome of each question."""
    draws, law, grid = before.draws, case.laws[NAME], np.arange(GRID_DEG.size, dtype=np.int64)
    assert draws is not None
    now = half_widths_now(draws.curves_db(law))
    after = {
        one: half_widths_after(
            draws, law, [ground.views[first]], [ground.views[one]], before.looks, case.uncertainty, grid
        )
        for one in PASSES
        if one != first
    }
    found = []
    for asked in questions:
        over = asked.over_deg
        assert over is not None
        of = (over[0] <= GRID_DEG) & (over[1] >= GRID_DEG)
        expected = [float(after[one][of].mean()) for one in asked.candidates]
        words = said(float(now[of].mean()), expected)
        named = peers(asked, first, over, ground) if words == ALONE else {}
        found.append(Outcome(words, int(np.argmin(expected)), named))
    return found


def counted(told: list[Outcome]) -> dict[str, dict[str, int]]:
    """Numbers of outcomes and, where one pass alone is named, how often each peer names the same."""
    words = [one.said for one in told]
    alone = [one for one in told if one.alone]
    return {
        "outcomes": {why: words.count(why) for why in dict.fromkeys(words)},
        "agree": {name: sum(one.peers[name] == one.best for one in alone) for name in PEERS},
    }


def said(now_db: float, expected_db: list[float]) -> str:
    """What ``radcal advise`` would say of three candidates with these half-widths."""
    best, equal = judged([one / now_db for one in expected_db])
    if best is None:
        return "none by a tenth"
    if len(equal) == len(expected_db) - 1:
        return "all within 5 %"
    return "two within 5 %" if equal else ALONE


def peers(asked: Question, first: Pass, over_deg: tuple[float, float], ground: Ground) -> dict[str, int]:
    """Choice of each peer that knows geometry and interval, as an index of the candidates."""
    middle = 0.5 * (over_deg[0] + over_deg[1])
    wanted = GRID_DEG[(over_deg[0] <= GRID_DEG) & (over_deg[1] >= GRID_DEG)]

    def within(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.bool_]:
        return np.asarray((values >= low) & (values <= high))

    own = within(wanted, *ground.seen_deg(first))
    inside, median, covered = [], [], []
    for one in asked.candidates:
        angles = ground.views[one].incidence_deg
        inside.append(float(within(angles, *over_deg).mean()))
        median.append(-abs(float(np.median(angles)) - middle))
        covered.append((float((own | within(wanted, *ground.seen_deg(one))).mean()), inside[-1]))
    return {
        name: max(range(len(scores)), key=scores.__getitem__)
        for name, scores in zip(PEERS, (inside, median, covered), strict=True)
    }


def calibrated(case: Case, ground: Ground, passes: list[Pass], folder: Path) -> Posterior:
    """Posterior after a calibration."""
    geometries = [ground.geometries[one] for one in passes]
    targets, history, _, images = calibrated_passes(case, ground.scene, geometries, folder)
    stage = STAGES["posterior"].of(case)
    parameters = case.start_parameters | {NAME: list(history.best(NAME).parameters)}
    cells = []
    for one, geometry, registered, found in zip(stage.passes, geometries, images, targets, strict=True):
        radar = one.radar.model_copy(update={"looks": LOOKS})
        simulated = Simulated(BuiltinSimulator(geometry, radar, one.laws).run(parameters, SEED), parameters)
        cells.append(observe(one, geometry, registered, [simulated], found.levels, ground.scene))
    objective = make_objectives(stage, targets)[NAME]
    return posterior_of(stage, targets, history, objective, cells, image_of(stage, cells))


def half_width_db(posterior: Posterior, over_deg: tuple[float, float]) -> float:
    """Mean half-width of the 90 % band of sigma0 over an interval of incidence [dB], of the whole sample."""
    curve = posterior.curve
    assert curve is not None
    of = (over_deg[0] <= curve.incidence_deg) & (curve.incidence_deg <= over_deg[1])
    return float(0.5 * (curve.p95_db - curve.p05_db)[of].mean())


def line(row: dict[str, Any]) -> str:
    """One number in words, with half-widths expected > found [dB]."""
    begin = f"{row['number']:3d} {np.round(row['truth'], 1)!s:24} first {row['first'][0]:g} {row['first'][1]:5}"
    if "found_db" not in row:
        return f"{begin} skipped: {row['outcomes']}"
    names = [f"{one[0]:g} {one[1]}" for one in row["candidates"]]
    each = zip(names, row["expected_db"], row["found_db"], strict=True)
    cells = ", ".join(f"{name} {expected:.2f} > {found:.2f}" for name, expected, found in each)
    advised, best = (names[int(np.argmin(row[key]))] for key in ("expected_db", "found_db"))
    over = "{:.0f}-{:.0f} deg".format(*row["over_deg"])
    return f"{begin} {over} {row['now_db']:.2f} | {cells} | advised {advised}, best {best}"


def chosen(rows: list[dict[str, Any]], choice: list[int]) -> dict[str, Any]:
    """How often a choice was the best one, and how much wider its band was than after the best one [%]."""
    found = np.array([row["found_db"] for row in rows])
    regret = (100.0 * (found / found.min(axis=1, keepdims=True) - 1.0))[np.arange(len(rows)), choice]
    return {
        "right": int((regret == 0.0).sum()),
        "within_5_percent": int((regret <= 5.0).sum()),
        "regret_percent": {"mean": round(float(regret.mean()), 2), "worst": round(float(regret.max()), 2)},
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Advice and peers on the same numbers, and how far the expected half-widths were from those found."""
    kept = [row for row in rows if "found_db" in row]
    advised = [int(np.argmin(row["expected_db"])) for row in kept]
    found = np.array([row["found_db"] for row in kept])
    of_best = found / found.min(axis=1, keepdims=True)
    ratio = np.array([row["expected_db"] for row in kept]) / found
    always = {}
    for one in PASSES:
        where = [row for row in kept if list(one) in row["candidates"]]
        if where:
            same = chosen(where, [row["candidates"].index(list(one)) for row in where])
            always[f"{one[0]:g} {one[1]}"] = {"n": len(where), **same}
    return {
        "n": len(kept),
        "skipped": len(rows) - len(kept),
        **{key: dict(sum((Counter(row.get(key, {})) for row in rows), Counter())) for key in ("outcomes", "agree")},
        "advice": chosen(kept, advised),
        **{name: chosen(kept, [row["peers"][name] for row in kept]) for name in PEERS},
        "random": {
            "right": round(len(kept) / found.shape[1], 2),
            "regret_percent": {
                "mean": round(100.0 * float(of_best.mean()) - 100.0, 2),
                "worst": round(100.0 * float(of_best.max()) - 100.0, 2),
            },
        },
        "always": always,
        "expected_over_found": [round(float(q), 2) for q in np.quantile(ratio, [0.0, 0.5, 1.0])],
        "now_db": float(np.median([row["now_db"] for row in kept])),
        "advised_db": float(np.median(found[np.arange(len(kept)), advised])),
        "others_db": float(np.median([np.delete(one, k).min() for one, k in zip(found, advised, strict=True)])),
    }


if __name__ == "__main__":
    main()
