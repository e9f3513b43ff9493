"""What starting a job costs: modules that take seconds are imported where they are used, and only there."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

SCRIPTS = sorted((Path(__file__).resolve().parents[1] / "workflow/scripts").glob("*.py"))
LATE = (
    "matplotlib",
    "numba",
    "pandas",
    "platypus",
    "rasterio",
    "scipy.stats",
    "skimage",
    "sklearn",
    "smt",
    "snakemake",
)


def test_no_script_imports_what_takes_seconds_before_it_is_used() -> None:
    found = [node for path in SCRIPTS for node in ast.parse(path.read_text()).body]
    imports = {ast.unparse(node) for node in found if isinstance(node, (ast.Import, ast.ImportFrom))}
    assert len(SCRIPTS) > 15
    assert "from radcal.report.figures import write_figures" in imports
    code = "\n".join([*sorted(imports), "import sys", f"print(*(name for name in {LATE} if name in sys.modules))"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
