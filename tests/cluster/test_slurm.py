"""A tiny case through a real Slurm: jobs cancelled, node drained, snakemake killed, same result; two runs at once."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from cluster.one_node import NODE, PARTITION, OneNode, missing
from waiting import wait_until
from workflow_project import make_project

# every job costs two starts of Snakemake: as few as there may be, with two chunks and an iteration
SMALL = {"design": {"size": 6, "chunk": 3}, "stop": {"rms": 1e-9, "max_runs": 7}}
PATIENCE_S = 600.0  # other tests may have the machine's cores


@pytest.fixture
def cluster():
    if (absent := missing()) is not None:
        pytest.skip(f"no Slurm here, missing: {absent}")
    with OneNode() as started:
        yield started


class Main:
    """The snakemake that submits the jobs."""

    def __init__(self, project):
        self.log = project.folder / f"main-{time.monotonic_ns()}.log"
        command = [
            *(sys.executable, "-m", "snakemake", "--profile", "profiles/slurm", "--configfile", "tiny.yaml"),
            # just above what a job takes: the plugin waits ten seconds longer each time that none has ended
            *("--slurm-init-seconds-before-status-checks", "6"),
        ]
        with self.log.open("wb") as out:
            self.process = subprocess.Popen(
                command, cwd=project.folder, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
            )

    @property
    def text(self):
        return self.log.read_text(errors="replace")

    def until(self, condition):
        return wait_until(condition, self.process, PATIENCE_S)

    def kill(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def of_rule(jobs, rule, *states):
    return [job for job in jobs if rule in job["rule"] and (not states or job["state"] in states)]


def test_cancelled_drained_killed_and_continued_is_the_same_as_undisturbed(cluster, warm, tmp_path):
    undisturbed = make_project(tmp_path / "undisturbed")
    undisturbed.write(**SMALL)
    undisturbed.interpreter = warm.interpreter()
    # beside the other one, which has one job at a time and waits for much of its own
    reference = ThreadPoolExecutor(1).submit(undisturbed.run, "--configfile", "tiny.yaml", cores=1)

    project = make_project(tmp_path / "cluster")
    project.write(**SMALL)
    profile = project.folder / "profiles" / "slurm" / "config.yaml"
    example = """  # slurm_partition: "'standard'"\n"""
    assert example in profile.read_text()
    profile.write_text(profile.read_text().replace(example, f"""  slurm_partition: "'{PARTITION}'"\n"""))

    def chunks_are(state):
        return all(job["state"] == state for job in cluster.jobs() if job["id"] in chunks)

    main = Main(project)
    try:
        # a simulating job is cancelled: it is submitted again, to begin later
        victim = main.until(lambda: of_rule(cluster.jobs(), "reference_run", "RUNNING"))[0]
        cluster.call("scancel", victim["id"])
        again = main.until(lambda: of_rule(cluster.jobs(), "reference_run")[1:])[0]
        assert of_rule(cluster.jobs(), "reference_run")[0]["state"] == "CANCELLED"
        assert seconds(again["started"]) - seconds(again["submitted"]) >= 14, "no back-off"
        assert megabytes(again) == 2 * megabytes(victim)

        # the node is drained while a job runs: that one ends, the next ones wait until it is back
        main.until(lambda: of_rule(cluster.jobs(), "target", "RUNNING"))
        cluster.call("scontrol", "update", f"nodename={NODE}", "state=drain", "reason=test")
        main.until(lambda: len(of_rule(cluster.jobs(), "design_chunk", "PENDING")) == 2)
        chunks = {job["id"] for job in of_rule(cluster.jobs(), "design_chunk")}
        assert of_rule(cluster.jobs(), "target")[0]["state"] == "COMPLETED"
        assert cluster.node_state() == "drained"
        assert main.process.poll() is None

        # the main process is killed: its jobs stay in the queue, until who comes after cancels them
        main.kill()
        first_log, before = main.text, project.records()
        assert not (project.out() / "summary.json").exists()
        assert len(of_rule(cluster.jobs(), "design_chunk", "PENDING")) == len(chunks)
        main = Main(project)
        main.until(lambda: len(of_rule(cluster.jobs(), "design_chunk", "PENDING")) == 2 and chunks_are("CANCELLED"))
        cluster.call("scontrol", "update", f"nodename={NODE}", "state=resume")
        assert main.process.wait(PATIENCE_S) == 0
        assert "radcal: 2 jobs of an earlier snakemake cancelled" in main.text
    finally:
        main.kill()
        sys.stdout.write(main.text)
        for job in cluster.jobs():
            sys.stdout.write(f"{ {key: value for key, value in job.items() if key != 'name'} }\n")

    done = reference.result()
    assert done.returncode == 0, done.stdout
    after = project.records()
    assert {name: after[name] for name in before} == before, "a finished run was made again"
    assert after.keys() == undisturbed.records().keys()
    mine, theirs = project.summary(), undisturbed.summary()
    assert mine["materials"] == theirs["materials"]
    assert mine["runs"] == theirs["runs"]
    assert not cluster.jobs(active=True)
    assert not (project.out() / ".slurm").exists()

    jobs = cluster.jobs()
    assert {job["partition"] for job in jobs} == {PARTITION}
    ended = {job["id"]: job["state"] for job in jobs if job["state"] != "COMPLETED"}
    assert ended == dict.fromkeys({victim["id"], *chunks}, "CANCELLED")
    # people see what jobs on the nodes say
    assert "scene: 96 x 80 cells" in first_log
    assert "after 6 design runs, the density of" in main.text
    assert [len(of_rule(jobs, rule)) for rule in ("iteration_propose_train_verify", "infill_run")] == [1, 0]

    # several runs of an iteration are jobs of their own, which other nodes may take
    project.write(**{**SMALL, "stop": {"rms": 1e-9, "max_runs": 8}}, infill={"batch": 2})
    main = Main(project)
    try:
        assert main.process.wait(PATIENCE_S) == 0
    finally:
        main.kill()
        sys.stdout.write(main.text)
    side_by_side = of_rule(cluster.jobs(), "infill_run")
    assert [job["state"] for job in side_by_side] == ["COMPLETED"] * 2
    assert len(of_rule(cluster.jobs(), "rule_verify")) == 1
    assert project.summary()["runs"]["infill"] == 2


def seconds(stamp):
    return time.mktime(time.strptime(stamp, "%Y-%m-%dT%H:%M:%S"))


def megabytes(job):
    number, unit = job["memory"][:-1], job["memory"][-1]
    return float(number) * {"M": 1, "G": 1024}[unit]
