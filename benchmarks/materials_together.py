"""Number of runs for all seven materials of the published dyke's scene in the same runs, and for each material alone.

    python benchmarks/materials_together.py [--quick] [--images 3]

The hidden laws are those of the published case. The measured images differ in their speckle. Together, all materials
are searched in the bounds of the dyke, from the start of the dyke. Alone, one material is searched, and the others have
their hidden laws. The objective is ``classes``, without a design.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import yaml
from dyke_cases import Bench

from radcal.calibration.loop import calibrate
from radcal.config import load
from radcal.config.yaml_file import read_case_file
from radcal.processes import one_thread

TRUTH = [6.1, 14.2, 21.5, 3.3]


def main() -> None:
    """Print a line per image and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 image in place of 3")
    parser.add_argument("--images", type=int, default=3, help="number of measured images")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder, one_thread():
        bench = Bench(Path(folder))
        for number in range(1 if arguments.quick else arguments.images):
            published = load([bench.speckled(f"image_{number}", TRUTH, 100 + number, {"design": {"size": 0}})])
            names = list(published.materials)
            together = searched(bench, Path(folder), number, names)
            alone = {name: searched(bench, Path(folder), number, [name])["runs"] for name in names}
            hardest = max(alone.values())
            print(f"image {number}: together {together}, alone {alone}", flush=True)
            rows.append({"together": together["runs"], "hardest": hardest, "ratio": together["runs"] / hardest})
    print(json.dumps({"images": rows}))


def searched(bench: Bench, folder: Path, number: int, free: list[str]) -> dict[str, Any]:
    """Infill runs, end, and largest error of a law [dB], if the materials ``free`` are calibrated."""
    data = read_case_file(folder / f"image_{number}.yaml")
    materials = data["materials"]
    searched = {key: materials["dyke"][key] for key in ("calibrate", "law", "bounds", "start")}
    hidden = {name: material.get("parameters", TRUTH) for name, material in materials.items()}
    for name in materials:
        fixed = {"calibrate": False, "law": "mangia", "parameters": hidden[name]}
        materials[name] = dict(searched) if name in free else fixed
    data["measurement"]["synthetic"]["parameters"] = {name: hidden[name] for name in free}
    path = folder / f"case_{number}_{len(free)}_{free[0]}.yaml"
    path.write_text(yaml.safe_dump(data))
    case = load([path])
    with tempfile.TemporaryDirectory() as runs:
        runner = bench.runner(case, Path(runs))
        targets = bench.targets(case, runner)
        history, decision = calibrate(case, [runner], [targets])
    errors = [
        case.laws[name].largest_difference_db(history.best(name).parameters, hidden[name], targets[name].incidence_deg)
        for name in free
    ]
    return {"runs": history.count("infill"), "ended": str(decision.reason), "error_db": round(max(errors), 2)}


if __name__ == "__main__":
    main()
