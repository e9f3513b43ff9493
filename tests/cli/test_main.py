"""The package as a command."""

import subprocess
import sys


def test_the_package_is_the_command():
    radcal = [sys.executable, "-m", "radcal"]
    done = subprocess.run([*radcal, "show", "gone"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("radcal: gone: there is no folder results/gone, expected the name of a case")
    assert "Usage: radcal compare" in subprocess.check_output([*radcal, "compare", "-h"], text=True)
