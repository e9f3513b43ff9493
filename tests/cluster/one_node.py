"""A real Slurm on this machine alone: munged, slurmctld and slurmd in a folder of their own, gone after the test.

No systemd, no control groups, no database. All three daemons stay children of the test and die with it.
"""

import os
import shutil
import socket
import subprocess
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

# snakemake's job step takes every SLURM_* variable from its srun: only the standard place reaches that
STANDARD = Path("/etc/slurm/slurm.conf")
PACKAGES = "munge slurm-client slurmctld slurmd"
DAEMONS = ("munged", "slurmctld", "slurmd")
PREFIX = "slurm-"
NODE = "node1"
PARTITION = "asked"  # beside the one that jobs get which ask for none

CONFIGURATION = """\
ClusterName=onenode
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
# begin times are met to the second, and jobs start as they come
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
ReturnToService=2
KillWait=2
MailProg=/bin/true
AccountingStorageType=accounting_storage/none
# squeue tells of finished jobs for so long
MinJobAge=3600
SlurmdParameters=config_overrides
NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=16000 State=UNKNOWN
PartitionName=default Nodes={node} Default=YES MaxTime=INFINITE State=UP
PartitionName={partition} Nodes={node} Default=NO MaxTime=INFINITE State=UP
"""


def find(program):
    """A program, also where only root looks."""
    return shutil.which(program, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def missing():
    """What keeps Slurm from running here, None if nothing does."""
    absent = [name for name in (*DAEMONS, "sbatch", "squeue", "scancel", "scontrol", "setpriv") if find(name) is None]
    if absent:
        return f"{', '.join(absent)} (apt-get install {PACKAGES})"
    if find_spec("snakemake_executor_plugin_slurm") is None:
        return "snakemake-executor-plugin-slurm (pip install '.[slurm]')"
    if os.geteuid() != 0:
        return "root, which slurmd and slurmctld are started as"
    if STANDARD.is_file() and not left_behind():
        return f"a free place for {STANDARD}: this machine is part of a cluster"
    return None


def left_behind():
    """Whether the configuration in the standard place is that of a test which was killed, its daemons gone with it."""
    folder = STANDARD.resolve().parent
    if not (STANDARD.is_symlink() and folder.name.startswith(PREFIX)):
        return False
    pid = folder / "slurmctld.pid"
    return not (pid.is_file() and Path(f"/proc/{pid.read_text().strip()}").exists())


def free_ports(number):
    sockets = [socket.socket() for _ in range(number)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()


class OneNode:
    """The cluster, for the length of a ``with`` block."""

    def __init__(self):
        # a socket's path has little room, less than a test's own folder takes
        self.folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir="/tmp"))
        self._daemons = []

    def __enter__(self):
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        if len(self._daemons) == len(DAEMONS):
            self.call("scancel", "--user=root", check=False)
            self._wait_until(lambda: not self.jobs(active=True), seconds=20, what=None)
        for daemon in reversed(self._daemons):
            daemon.terminate()
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        if STANDARD.is_symlink() and os.readlink(STANDARD) == str(self.folder / "slurm.conf"):
            STANDARD.unlink()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _start(self):
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        key = self.folder / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(os.urandom(1024))
        (self.folder / "slurm.conf").write_text(
            CONFIGURATION.format(
                folder=self.folder,
                host=socket.gethostname().split(".")[0],
                ports=free_ports(2),
                node=NODE,
                partition=PARTITION,
            )
        )
        STANDARD.parent.mkdir(parents=True, exist_ok=True)
        if STANDARD.is_symlink():  # of a test that was killed, says missing()
            STANDARD.unlink()
        STANDARD.symlink_to(self.folder / "slurm.conf")
        self._daemon(
            "munged",
            "--foreground",
            "--force",  # the folder may be private, which munged would not have
            f"--key-file={key}",
            f"--socket={self.folder}/munge.socket",
            f"--pid-file={self.folder}/munged.pid",
            f"--seed-file={self.folder}/munge.seed",
        )
        self._wait_until((self.folder / "munge.socket").exists, seconds=20, what="munged does not open its socket")
        self._daemon("slurmctld", "-D", "-c", "-f", f"{self.folder}/slurm.conf")
        self._daemon("slurmd", "-D", "-f", f"{self.folder}/slurm.conf")
        self._wait_until(lambda: self.node_state() == "idle", seconds=60, what="the node does not come up")

    def _daemon(self, program, *arguments):
        with (self.folder / f"{program}.out").open("wb") as out:
            self._daemons.append(
                subprocess.Popen(
                    ["setpriv", "--pdeathsig", "TERM", str(find(program)), *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=subprocess.STDOUT,
                    env=self._environment(),
                    start_new_session=True,  # what is sent to the test's group is not for them
                )
            )

    @staticmethod
    def _environment():
        return {name: value for name, value in os.environ.items() if not name.startswith(("SLURM_", "SBATCH_"))}

    def _wait_until(self, condition, *, seconds, what):
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                if what is None:
                    return
                logs = [path.read_text(errors="replace")[-1500:] for path in self.folder.glob("*.[lo][ou][gt]")]
                raise AssertionError(f"{what}\n" + "\n".join(logs))
            time.sleep(0.1)

    def call(self, *command, check=True):
        """Standard output of a Slurm command."""
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=self._environment())
        assert done.returncode == 0 or not check, f"{command}: {done.stderr}"
        return done.stdout

    def node_state(self):
        return self.call("sinfo", "--noheader", f"--partition={PARTITION}", "--format=%T", check=False).strip()

    def jobs(self, active=False):
        """Jobs in the order of submission: number, rule, state, reason, and what they asked for."""
        fields = {"id": "%i", "rule": "%k", "state": "%T", "reason": "%r", "memory": "%m", "partition": "%P"}
        fields |= {"name": "%j", "cpus": "%C", "limit": "%l", "submitted": "%V", "started": "%S", "ended": "%e"}
        states = [] if active else ["--states=all"]
        text = self.call("squeue", "--noheader", *states, f"--format={'|'.join(fields.values())}", check=False)
        rows = [dict(zip(fields, line.split("|"), strict=True)) for line in text.splitlines() if line]
        return sorted(rows, key=lambda row: int(row["id"]))
