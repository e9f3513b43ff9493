"""What starting a job costs: modules that take seconds are imported where they are used, and only there."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = sorted((Path(__file__).resolve().parents[1] / "workflow/scripts").glob("*.py"))
LATE = ("matplotlib", "pandas", "platypus", "pyogrio", "rasterio", "scipy.stats", "skimage", "sklearn", "smt")
LATE += ("scipy.linalg", "scipy.ndimage", "scipy.optimize", "snakemake")
# numba takes half a second: for those that compute geometry or simulate
SIMULATE = {"products", "frame", "geometry", "strip", "measurement", "simulator"}
SIMULATE |= {"reference", "design_chunk", "verify", "final_runs", "reuse"}


@pytest.mark.slow
def test_no_script_imports_what_takes_seconds_before_it_is_used():
    imports = imports_of(SCRIPTS)
    assert len(SCRIPTS) > 15
    assert "from radcal.figures.figures import write_figures" in imports
    assert loaded(imports, LATE) == []


@pytest.mark.slow
def test_scripts_that_do_not_simulate_import_no_compiler():
    assert {path.stem for path in SCRIPTS} > SIMULATE
    assert loaded(imports_of([path for path in SCRIPTS if path.stem not in SIMULATE]), ("numba",)) == []
    assert loaded(imports_of([path for path in SCRIPTS if path.stem == "geometry"]), ("numba",)) == ["numba"]


def imports_of(scripts):
    """Import statements at the top of scripts."""
    found = [node for path in scripts for node in ast.parse(path.read_text()).body]
    return sorted({ast.unparse(node) for node in found if isinstance(node, (ast.Import, ast.ImportFrom))})


def loaded(imports, names):
    """Those of the modules that a process has loaded after the imports."""
    code = "\n".join([*imports, "import sys", f"print(*(name for name in {names} if name in sys.modules))"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_scipy_loaded_late_has_one_thread_where_one_is_asked_for():
    code = (
        "import sys, radcal.registration.gefolki, threadpoolctl\n"
        "from radcal.processes import one_thread\n"
        "print('scipy.linalg' in sys.modules)\n"
        "with one_thread():\n"
        "    import scipy\n"
        "    scipy.linalg.cho_factor([[2.0]])\n"
        "    print(*[one['num_threads'] for one in threadpoolctl.threadpool_info()])\n"
    )
    two = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", code], env=two, capture_output=True, text=True, check=True)
    late, *threads = done.stdout.split()
    assert late == "False"
    assert len(threads) >= 2  # NumPy's library and SciPy's
    assert set(threads) == {"1"}
