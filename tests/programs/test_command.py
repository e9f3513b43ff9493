"""An external program behind the protocol: handing over, reading back, and every way to fail."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from raster_files import write_raster
from waiting import wait_until

from radcal.config import case_from
from radcal.errors import ConfigError, SimulatorError
from radcal.programs import command as module
from radcal.programs.command import CommandSimulator
from radcal.programs.command_plan import changed_links
from radcal.storage.files import alive

MATERIALS = {
    "dyke": {"calibrate": True, "law": "external", "names": ["mv", "s"], "bounds": [[0, 1], [0, 9]]},
    "grass": {"parameters": [10.0, 14.0, 6.0, 4.0]},
}
X = {"dyke": [0.1, 1e-17], "grass": [10.0, 14.0, 6.0, 4.0]}
GRASS = ("X1", "X2", "X3", "X4")
# standard library only, so that a run takes milliseconds
WORKING = """
import array, json, random, sys
run = json.load(open(sys.argv[1]))
draw = random.Random(run["noise_seed"])
level = run["parameters"]["dyke"]["mv"]
rows, columns = run["shape"]
with open(run["output"], "wb") as file:
    array.array("f", [level + draw.gauss(0, 1) for _ in range(rows * columns)]).tofile(file)
"""


RAW = {"file": "image.raw", "format": "raw", "dtype": "float32", "scale": "db"}
# where the program has computed no number
MEND = (
    ", in the run with dyke.mv = 0.1, dyke.s = 1e-17: mend the program (and its simulator.version, if none of its "
    "files changes), or set bounds in which it computes all pixels; its folder is kept as"
)
SYNTHETIC = {"source": "synthetic", "synthetic": {"parameters": {}}}


@pytest.fixture
def make(tmp_path, geometry, radar):
    """Simulator of a script, with changes of its section, on two materials."""

    def make(script=WORKING, materials=MATERIALS, **changes):
        (tmp_path / "sim.py").write_text(script)
        simulator = {
            "kind": "command",
            "command": ["{python}", "-S", "-E", "sim.py", "{input}"],
            "input": {},
            "files": [str(tmp_path / "sim.py")],
            "output": RAW,
            "timeout_s": 60,
        } | changes
        case = case_from({"simulator": simulator, "materials": materials, "measurement": SYNTHETIC})
        part = SimpleNamespace(simulator=case.simulator, materials=case.materials, radar=radar)
        return CommandSimulator(part, geometry, tmp_path / "geometry.h5")

    return make


def folders(tmp_path):
    return sorted(path.name for path in (tmp_path / "external").iterdir())


@pytest.mark.parametrize(
    ("write", "said"),
    [
        ("pathlib.Path('data/cache').write_text('new')", "simulator.links: data/cache changed while the program ran"),
        ("pathlib.Path('data/table').write_text('2')", "simulator.links: data/table changed while the program ran"),
        ("[pathlib.Path(f'data/{x}').touch() for x in 'ab']", "simulator.links: data/a and 1 more changed while"),
        ("pathlib.Path('data/table').write_text('1')", ""),
    ],
)
def test_a_program_that_changes_its_links_is_told(make, tmp_path, write, said):
    (tmp_path / "data").mkdir()
    (tmp_path / "data/table").write_text("1")
    simulator = make(WORKING + f"\nimport pathlib\n{write}\n", links=[str(tmp_path / "data")])
    identity = simulator.identity
    simulator.run(X, 7)
    sentence = changed_links(SimpleNamespace(simulator=simulator._config, materials=simulator._materials), identity)
    assert sentence.startswith(said)
    assert bool(sentence) == bool(said)


def test_only_the_beginning_of_a_version_is_read(make):
    simulator = make(version_command=["{python}", "-c", "print('v 2', 4000 * 'x' + 4000 * ' y')"])
    assert simulator.identity["version"] == "v 2 " + 196 * "x"


def test_input_files_templates_and_arguments_say_the_same(make, tmp_path, radar):
    """Numbers in full; those of whole parameters without a decimal point, seeds in a range with its ends."""
    numbers = "%dyke.mv%|%dyke.mv:9.2e%|%dyke.s%|%dyke.s:4d%|%noise_seed:1..8%"
    (tmp_path / "t.tpl").write_text(f"{numbers}\n%grass.X1% %grass.X2% %grass.X3% %grass.X4%")
    words = ["--mv={dyke.mv}", "{dyke.s}", "{noise_seed}", "{noise_seed:-9..-3}", "{geometry}", "a b; $HOME"]
    simulator = make(
        WORKING + "json.dump(sys.argv[2:], open('arguments.json', 'w'))\n",
        MATERIALS | {"dyke": MATERIALS["dyke"] | {"integer": ["s"]}},
        command=["{python}", "sim.py", "{input}", *words],
        templates=[{"template": str(tmp_path / "t.tpl"), "file": "sub/t.inp", "delimiter": "%"}],
        keep_folders=True,
    )
    simulator.run({**X, "dyke": [1e-17, 3.0]}, 2**63 - 1)
    (folder,) = (tmp_path / "external").iterdir()
    arguments = json.loads((folder / "arguments.json").read_text())
    assert float(arguments[0].removeprefix("--mv=")) == 1e-17
    assert arguments[1:] == ["3", str(2**63 - 1), "-9", str(tmp_path / "geometry.h5"), "a b; $HOME"]
    assert (folder / "sub/t.inp").read_text() == "1e-17| 1.00e-17|3|   3|8\n10.0 14.0 6.0 4.0"
    data = json.loads((folder / "input.json").read_text())
    assert data["parameters"] == {"dyke": {"mv": 1e-17, "s": 3}, "grass": dict(zip(GRASS, X["grass"], strict=True))}
    assert isinstance(data["parameters"]["dyke"]["s"], int)
    assert data["radar"] == radar.model_dump(mode="json")


def test_toml_input_is_the_json_input_and_may_be_without_the_pass(make):
    script = WORKING.replace("import array, json", "import array, tomllib").replace("json.load", "tomllib.load")
    script = script.replace("open(sys.argv[1])", "open(sys.argv[1], 'rb')") + "assert 'radar' not in run\n"
    found = make(script, input={"file": "run.toml", "format": "toml", "radar": False}).run(X, 3)
    np.testing.assert_array_equal(found, make(WORKING).run(X, 3))


def write_h5(path, values):
    with h5py.File(path, "w") as file:
        file["other"] = values[:2]
        file["a/image"] = values


def write_tif(path, values):
    write_raster(path, np.stack([0 * values, values]))


def header(dtype):
    return lambda path, values: path.write_bytes(b"head" + values.astype(dtype).tobytes())


@pytest.mark.parametrize(
    ("output", "write"),
    [
        ({"file": "i.npy", "scale": "power"}, np.save),
        ({"file": "i.npz", "scale": "amplitude"}, lambda path, values: np.savez(path, image=values)),
        ({"file": "i.h5", "scale": "db", "dataset": "a/image"}, write_h5),
        ({"file": "image.out", "scale": "complex", "dataset": "a/image", "format": "hdf5"}, write_h5),
        ({"file": "out/i.tif", "scale": "db", "band": 2}, write_tif),
        (
            {"file": "i.bin", "scale": "complex", "format": "raw", "dtype": "complex64", "byte_order": "big",
             "header_bytes": 4},
            header(">c8"),
        ),
        ({"file": "i.bin", "scale": "power", "format": "raw", "dtype": "float64", "header_bytes": 4}, header("<f8")),
    ],
    ids=["npy", "npz", "hdf5", "hdf5 by declaration", "raster", "raw, complex, big", "raw, little"],
)  # fmt: skip
@pytest.mark.parametrize("turned", [False, True])
def test_every_format_scale_and_orientation(make, geometry, tmp_path, output, write, turned):
    rng = np.random.default_rng(1)
    expected = rng.normal(-10.0, 5.0, geometry.shape)
    power = 10 ** (expected / 10)
    values = {"db": expected, "power": power, "amplitude": np.sqrt(power)}
    values["complex"] = np.sqrt(power) * np.exp(2j * np.pi * rng.random(geometry.shape))
    written = values[output["scale"]]
    if turned:
        # what the configuration undoes: rows flipped, then transposed
        written, output = written[::-1].T, output | {"transpose": True, "flip_rows": True}
    write(tmp_path / Path(output["file"]).name, written)
    simulator = make(
        "import shutil, sys; shutil.copy(*sys.argv[1:])",
        command=["{python}", "sim.py", str(tmp_path / Path(output["file"]).name), "{output}"],
        output=output,
    )
    np.testing.assert_allclose(simulator.run(X, 1), expected, atol=1e-4)


@pytest.mark.parametrize(
    ("script", "changes", "words"),
    [
        ("import time; print('still here', flush=True); time.sleep(100)", {"timeout_s": 0.5},
         ["was not done after 0.5", "simulator.timeout_s: 0.5", "still here"]),
        (WORKING + "sys.exit('no licence\\nfor this host')", {},
         ["ended with exit code 1", "simulator.accept_exit_codes", '"no licence / for this host"']),
        (WORKING + "import os; os.kill(os.getpid(), 9)", {}, ["signal 9 (SIGKILL)", "it printed nothing"]),
        ("print('done')", {}, ["ended with exit code 0", "left no file image.raw", "simulator.output.file", '"done"']),
        ("import os; os.mkdir('image.raw')", {}, ["left a folder image.raw (simulator.output.file)"]),
        ("import subprocess; subprocess.Popen(['sh', '-c', 'sleep 0.5; echo > image.raw'])", {}, ["left no file"]),
        ("import sys\nfor k in range(20): sys.stderr.write(10**6 * 'x')\nsys.exit('full')", {},
         ["exit code 1", 'xxfull"']),
        ("import sys; sys.stderr.buffer.write(bytes(range(256))); sys.exit(2)", {}, ["exit code 2", "ABCDEF"]),
        (WORKING, {"command": ["{python}", "-S", "sim.py", "{input}", 3_000_000 * "x"]},
         ["python", "cannot be started (Argument list too long)"]),
        (WORKING.replace("rows * columns", "rows"), {}, ["simulator.output.file: ", "bytes, expected"]),
        (WORKING.replace("level +", "float('nan') +"), {}, ["holds no finite number", MEND]),
        (WORKING.replace("level +", "(level if _ % 2 else float('nan')) +"), {},
         ["of the", "pixels of dyke", "NaN", MEND]),
        (WORKING.replace("level +", "1e4 +"), {}, ["within +-200 dB", "simulator.output.scale"]),
        (WORKING, {"output": {"file": "image.raw", "format": "npy", "scale": "db"}},
         ["cannot be read as a numpy", "in the run with dyke.mv = 0.1, dyke.s = 1e-17; its folder"]),
        (WORKING, {"output": RAW | {"scale": "power"}},
         ["negative, which power cannot be", "simulator.output.scale: db"]),
    ],
    ids=["hanging", "exit 1", "killed", "no output", "a folder", "late", "huge stderr",
         "binary stderr", "long argument", "too short", "all NaN", "half NaN", "200 dB", "not npy", "wrong scale"],
)  # fmt: skip
def test_failures_end_in_one_sentence_and_keep_the_folder(make, tmp_path, script, changes, words):
    with pytest.raises(SimulatorError) as caught:
        make(script, **changes).run(X, 1)
    message = str(caught.value)
    assert message.startswith("simulator.")
    assert "\n" not in message
    for word in words:
        assert word in message
    (kept,) = folders(tmp_path)
    assert f"kept as {tmp_path / 'external' / kept}." in message
    assert kept.startswith("failed-")
    assert ".partial" not in message
    assert {"radcal.stdout", "radcal.stderr", "sim.py", "input.json"} <= set(os.listdir(tmp_path / "external" / kept))


def test_a_program_that_takes_its_folder_away(make, tmp_path):
    with pytest.raises(SimulatorError, match=r"^simulator\.command: python.* ended with exit code 0 but left no file"):
        make("import os, shutil; shutil.rmtree(os.getcwd())").run(X, 1)
    assert folders(tmp_path) == []


def test_names_beyond_ascii(make, tmp_path):
    (tmp_path / "Gelände ☃.dat").write_text("1")
    (tmp_path / "ü.tpl").write_text("Höhe ☃ @dyke.mv@\n", encoding="utf-8")
    simulator = make(
        WORKING + "assert open(sys.argv[2]).read() == '1' and sys.argv[2][0] == 'G'\n"
        "assert open('ü.inp', encoding='utf-8').read() == 'Höhe ☃ 0.1\\n'\n",
        command=["{python}", "-S", "-X", "utf8", "sim.py", "{input}", "Gelände ☃.dat"],
        files=[str(tmp_path / "sim.py"), str(tmp_path / "Gelände ☃.dat")],
        templates=[{"template": str(tmp_path / "ü.tpl"), "file": "ü.inp"}],
        output=RAW | {"file": "Bild ☃.raw"},
        environment={"GELÄNDE": "☃"},
    )
    np.testing.assert_array_equal(simulator.run(X, 1), make().run(X, 1))


@pytest.mark.parametrize(
    ("more", "transpose", "said"),
    [
        ([0, 0], False, None),
        ([0, 1], False, r"rows \(slant range\) and \d+ columns \(azimuth\): write shape"),
        (None, False, r"write simulator\.output\.transpose: true if the rows of the file run the other way"),
        (None, True, None),
        ([0, 0], True, r"write simulator\.output\.transpose: false if the rows of the file"),
    ],
)
def test_a_raw_file_of_another_size_is_refused_before_any_run(make, geometry, tmp_path, more, transpose, said):
    """The shape of the file is that of the scene's image with so many more rows and columns, or exchanges both."""
    shape = geometry.shape[::-1] if more is None else tuple(np.add(geometry.shape, more))
    output = RAW | {"shape": [int(n) for n in shape], "transpose": transpose}
    if said is None:
        make(output=output)
        return
    with pytest.raises(ConfigError, match=rf"^simulator\.output\.shape is \[.*{said}"):
        make(output=output)
    assert not (tmp_path / "external").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\x00\x01no program", r"exit code 126.*cannot be started: Exec format error"),
        (b"#!/no/such/interpreter\n", "cannot be started: the interpreter of its first line is missing"),
        (b"#!/bin/sh\r\n", "cannot be started: the interpreter of its first line is missing"),
    ],
)
def test_a_program_that_cannot_be_started_says_so(make, tmp_path, content, said):
    (tmp_path / "sim").write_bytes(content)
    (tmp_path / "sim").chmod(0o755)
    with pytest.raises(SimulatorError, match=said):
        make(command=[str(tmp_path / "sim")]).run(X, 1)


def test_failed_runs_are_tried_again_after_longer_and_longer(make, tmp_path, monkeypatch):
    waits = []
    # not time.sleep itself, which waiting for processes calls too
    monkeypatch.setattr(module, "time", SimpleNamespace(sleep=waits.append))
    counter = f"import pathlib\ncount = pathlib.Path({str(tmp_path / 'count')!r})\n"
    counter += "count.write_text(count.read_text() + '.' if count.exists() else '.')\n"
    script = counter + "if len(count.read_text()) < 4: raise SystemExit(3)\n" + WORKING
    expected = make().run(X, 5)
    np.testing.assert_array_equal(make(script, retries=3, retry_wait_s=0.5).run(X, 5), expected)
    assert waits == [0.5, 1.0, 2.0]
    (tmp_path / "count").unlink()
    with pytest.raises(SimulatorError, match=r"exit code 3.*attempt 2 of 2\.$"):
        make(script, retries=1).run(X, 5)
    # what another try would only repeat is not tried again
    waits.clear()
    with pytest.raises(SimulatorError, match="200 dB"):
        make(WORKING.replace("level +", "1e4 +"), retries=3).run(X, 5)
    assert waits == []


def test_programs_that_fail_after_their_output_can_be_accepted(make):
    expected = make().run(X, 5)
    np.testing.assert_array_equal(make(WORKING + "sys.exit(4)", accept_exit_codes=[0, 4]).run(X, 5), expected)
    crashing = WORKING + "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    np.testing.assert_array_equal(make(crashing, accept_exit_codes=[-11]).run(X, 5), expected)


FAMILY = """
import os, pathlib, subprocess, sys, time
child = subprocess.Popen(["sleep", "300"])
pathlib.Path({path!r}).write_text(f"{{os.getpid()}} {{child.pid}} .")
time.sleep(300)
"""


def family(path):
    return [int(pid) for pid in path.read_text().split()[:2]]


@pytest.mark.slow
def test_a_time_out_ends_the_programs_children_too(make, tmp_path):
    path = tmp_path / "pids"
    with pytest.raises(SimulatorError, match="was not done"):
        make(FAMILY.format(path=str(path)), timeout_s=3).run(X, 1)
    wait_until(lambda: not any(map(alive, family(path))), seconds=20)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_program_dies_with_radcal(tmp_path, number):
    path = tmp_path / "pids"
    (tmp_path / "sim.py").write_text(FAMILY.format(path=str(path)))
    # a shell's background jobs, and what they start, ignore Ctrl-C
    radcal = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    radcal += "from pathlib import Path; from radcal.programs.process import run_program; " + (
        f"run_program([{sys.executable!r}, 'sim.py'], Path({str(tmp_path)!r}), {{}}, 300)"
    )
    process = subprocess.Popen([sys.executable, "-c", radcal], stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: path.exists() and path.read_text().endswith("."), seconds=20)
        pids = family(path)
        assert all(map(alive, pids))
        process.send_signal(number)
        process.wait(20)
        wait_until(lambda: not any(map(alive, pids)), seconds=20)
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()


def test_identity_tells_all_that_may_change_the_image(make, tmp_path):
    (tmp_path / "a.tpl").write_text("@dyke.mv@")
    (tmp_path / "b.tpl").write_text("@dyke.mv@ ")
    (tmp_path / "data").mkdir()
    (tmp_path / "data/table").write_text("1")

    def template(name):
        return {"templates": [{"template": str(tmp_path / name), "file": "x"}]}

    changes = [
        {},
        {"script": WORKING + "#"},
        {"command": ["{python}", "sim.py", "{input}", "1"]},
        {"version": "1.2"},
        {"version": "1.3"},
        {"name": "other"},
        {"environment": {"A": "1"}},
        {"output": RAW | {"flip_rows": True}},
        {"input": {"format": "toml"}},
        {"version_command": ["{python}", "-c", "print('v 2', 7)"]},
        {"links": [str(tmp_path / "data")]},
        template("a.tpl"),
        template("b.tpl"),
    ]
    texts = [json.dumps(make(**change).identity, sort_keys=True) for change in changes]
    (tmp_path / "data/table").write_text("2")
    texts.append(json.dumps(make(links=[str(tmp_path / "data")]).identity, sort_keys=True))
    assert len(set(texts)) == len(texts)
    assert make(version_command=["{python}", "-c", "print('v 2', 7)"]).identity["version"] == "v 2 7"
    same = {"timeout_s": 5, "retries": 2, "retry_wait_s": 9, "accept_exit_codes": [0, 1], "keep_folders": True}
    same |= {"seed_bits": 16, "seedless": True}
    assert json.dumps(make(**same, deterministic=False).identity, sort_keys=True) == texts[0]
    # as in every version: a new key would be another simulator, and all runs new
    assert make().identity["input"] == {"file": "input.json", "format": "json"}
    assert folders(tmp_path) == []


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import time; time.sleep(100)", r"was not done after (0\.[3-9]|[12]\b)\S* s and was"),
        ("raise SystemExit(3)", "ended with exit code 3"),
    ],
)
def test_a_version_command_that_fails_is_told(make, monkeypatch, code, words):
    monkeypatch.setattr(module, "_VERSION_SECONDS", 0.3 if "sleep" in code else 60.0)
    with pytest.raises(SimulatorError, match=rf"^simulator\.version_command: python\S* {words}"):
        _ = make(version_command=["{python}", "-c", code]).identity


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"command": ["no-such-program"]}, r"^simulator\.command: no program 'no-such-program' on the PATH"),
        ({"command": ["./nowhere/sim"]}, r"^simulator\.command: the file nowhere/sim does not exist"),
        ({"command": [__file__]}, r"^simulator\.command: /.*test_command\.py is not executable: type chmod \+x"),
        ({"command": ["sh", "{dyke.mw}"]}, r"^simulator\.command\.1: unknown placeholder 'dyke\.mw' \(did you mean"),
        ({"command": ["sh", "{input}"], "input": None}, r"unknown placeholder 'input'"),
        ({"command": ["sh", "{dyke.mv}"], "input": None},
         r"^simulator: the parameter dyke\.s never reaches the program \(nor do 4 more\)"),
        ({"files": ["nowhere.dat"]}, r"^simulator\.files\.0: the file nowhere\.dat does not exist"),
        ({"command": [""]}, r"^simulator\.command: its first word is empty"),
        ({"command": ["sh", "a\0b"]}, r"simulator\.command\.1: is 'a.+b', expected text without a null character"),
        ({"command": "./sim --x {input}"}, r"simulator\.command: is '\./sim --x .+', expected a list of program"),
        ({"environment": {"A=B": "1"}}, r"simulator\.environment: 'A=B' is not a name of an environment variable"),
        ({"links": [str(Path(__file__).parent)], "input": {"file": "programs/in.json"}},
         r"input\.file is 'programs/in\.json', inside links\.0"),
        ({"output": {"file": "sim.py/i.npy", "scale": "db"}}, r"output\.file is 'sim\.py/i\.npy', inside files\.0"),
        ({"templates": [{"template": "no.tpl", "file": "a"}]}, r"^simulator\.templates\.0\.template: the file no\.tpl"),
    ],
)  # fmt: skip
def test_refused_before_any_run(make, tmp_path, changes, words):
    with pytest.raises(ConfigError, match=words):
        make(**changes)
    assert not (tmp_path / "external").exists()


def test_numbers_in_the_environment_are_text(make):
    checks = "import os; assert (os.environ['THREADS'], os.environ['SCALE']) == ('4', '0.5')\n"
    make(checks + WORKING, environment={"THREADS": 4, "SCALE": 0.5}).run(X, 1)
