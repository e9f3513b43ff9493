"""Warm process: has imported what Snakemake and the jobs import, and forks them, for commands that are not killed.

The workflow stays the real one: Snakefile, rules, profile and scripts as they are, one process for Snakemake and one
for each job. Only the start of an interpreter and its imports, three quarters of a tiny calibration's CPU time, are
spent once, and fonts in PDF files are of Type 3. Whatever is killed, the wheel (``.ci/wheel``) and jobs of the cluster
start as people start them.
"""

import ast
import contextlib
import gc
import importlib
import io
import json
import os
import random
import runpy
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from radcal.session.jobs import die_with_parent

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent / "workflow" / "scripts"
# imported by the library only where they are used
LATE = (
    "emcee", "h5py", "jinja2", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_pdf",
    "matplotlib.figure", "numba", "platypus", "radcal.assessment.model", "rasterio", "scipy.interpolate",
    "scipy.optimize", "scipy.stats", "snakemake.cli", "snakemake.script",
)  # fmt: skip


class Warm:
    """The server, for the length of a ``with`` block."""

    def __enter__(self):
        # a socket's path has little room, less than a test's own folder takes
        self._folder = tempfile.TemporaryDirectory(prefix="warm-")
        self._socket = Path(self._folder.name) / "socket"
        # matrix products of one thread, as every rule of the tiny case asks for
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        self._server = subprocess.Popen(
            [sys.executable, __file__, str(self._socket)],
            env=os.environ | threads, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        while not self._socket.exists():
            assert self._server.poll() is None, "the warm process did not start"
            time.sleep(0.02)
        return self

    def __exit__(self, *_):
        self._server.terminate()
        self._server.wait()
        self._folder.cleanup()

    def interpreter(self):
        """What takes the place of ``python`` in a command."""
        return interpreter(str(self._socket))


def interpreter(path):
    return [sys.executable, "-ISE", str(HERE / "warm_client.py"), path]


def preload():
    """Import what the scripts name, and what they come to later; nothing of it starts a thread, to fork safely."""
    for script in sorted(SCRIPTS.glob("*.py")):
        for node in ast.parse(script.read_text()).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                importlib.import_module(node.module)
    for name in LATE:
        importlib.import_module(name)
    rehearse()


def rehearse():
    """Form an image and draw a figure, so that machine code and fonts are loaded before the fork, not in each job."""
    import matplotlib as mpl

    from radcal.config import Radar
    from radcal.figures.drawing import STYLE, new_canvas
    from radcal.radar.image import ImageFormation
    from radcal.radar.reflectivity import uniform

    ImageFormation(Radar(), (20, 20), -20.0).intensity(uniform(np.ones((20, 20), np.float32)), 1)
    # Type 42, as users get it, takes a quarter of a report's time; the cluster writes it
    STYLE["pdf.fonttype"] = 3
    with mpl.rc_context(STYLE):
        canvas = new_canvas(3.0, 2.0)
        canvas.subplots().plot([-1.0, 2.0], label="a")
        for ending in ("png", "pdf"):
            canvas.savefig(io.BytesIO(), format=ending)


def serve(path):
    """Answer requests; returns in the forked processes alone, with what they are to run."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path + "-")
    listener.listen(64)
    os.rename(path + "-", path)
    running = set()
    selector = selectors.DefaultSelector()
    selector.register(listener, selectors.EVENT_READ)
    while True:
        for key, _ in selector.select():
            if key.fileobj is listener:
                client, _ = listener.accept()
                request, files = receive(client)
                if (pid := os.fork()) == 0:
                    selector.close()
                    listener.close()
                    client.close()
                    return become(path, request, files)
                for file in files:
                    os.close(file)
                running.add(pid)
                ended = os.pidfd_open(pid)
                selector.register(ended, selectors.EVENT_READ, (pid, client, ended))
                selector.register(client, selectors.EVENT_READ, (pid, client, ended))
                continue
            pid, client, ended = key.data
            if pid not in running:  # the other of the two came first in this round
                continue
            running.remove(pid)
            if key.fileobj is client:  # nobody waits for it any more
                os.kill(pid, signal.SIGKILL)
                with contextlib.suppress(ProcessLookupError):  # killed before it had a group of its own
                    os.killpg(pid, signal.SIGKILL)
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            if key.fileobj is not client:
                with contextlib.suppress(OSError):
                    client.sendall(code.to_bytes(8, "big", signed=True))
            selector.unregister(ended)
            selector.unregister(client)
            os.close(ended)
            client.close()


def receive(client):
    head, files, _, _ = socket.recv_fds(client, 8, 3)
    content = b""
    while len(content) < int.from_bytes(head, "big"):
        content += client.recv(1 << 20)
    return json.loads(content), files


def become(path, request, files):
    """Take on the client's folder, environment, files and arguments."""
    os.setsid()
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    random.seed()
    np.random.seed()  # noqa: NPY002
    first, *rest = request["arguments"]
    if first == "-m":
        module, *arguments = rest
        sys.argv, sys.path[0] = [module, *arguments], request["folder"]
        import snakemake.script

        # its scripts come here, too; nothing else that it starts does
        snakemake.script.sys = type(sys)("sys")
        vars(snakemake.script.sys).update(vars(sys), executable=" ".join(interpreter(path)))
        return lambda: runpy.run_module(module, run_name="__main__", alter_sys=True)
    sys.argv, sys.path[0] = [first, *rest], str(Path(first).parent)
    # as in radcal/__init__.py, which has been imported without this variable
    if "RADCAL_OWNER" in os.environ:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return lambda: runpy.run_path(first, run_name="__main__")


if __name__ == "__main__":
    die_with_parent()
    preload()
    gc.freeze()
    serve(sys.argv[1])()
