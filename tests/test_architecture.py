"""Direction of imports: from the code of ``src/radcal``, no circle, no step against the flow of data.

A *room* is a package or a top-level module of ``radcal``. Every import counts, wherever it stands:

- inside a function, because it runs: a circle that is only put off until the call is still a circle;
- under ``TYPE_CHECKING``, because whoever changes the type must look here as well, though nothing is loaded.

``docs/architecture.md`` describes the rooms.
"""

import ast
import functools
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src/radcal"

# Steps of the flow, first to last, by the packages and modules that take them; the longest name that fits counts.
# A module may import its own step and earlier ones. Rooms that are not named here serve several steps.
FLOW = [
    ("scene", ["scene", "vectors", "cdb"]),
    ("geometry and image formation", ["compiled", "speckle", "radar"]),
    ("simulator", ["programs", "simulators"]),
    ("raw signals", ["signals"]),
    ("measurement", ["image", "sentinel1", "ground", "registration", "measurement"]),
    ("inference", ["inference"]),
    ("target", ["targets"]),
    ("objectives", ["objectives"]),
    ("design", ["proposals.design"]),
    ("surrogate", ["proposals.surrogate", "proposals.kriging", "proposals.smt_kriging"]),
    ("proposal", ["proposals.nsga2", "proposals.search"]),
    ("verification", ["calibration.steps", "calibration.stopping", "calibration.loop"]),
    ("assessment", ["posterior", "assessment"]),
    ("report", ["results", "figures", "page", "ppi", "gmti", "products"]),
]


@functools.cache
def imports(root):
    """Pairs of module and imported module of a package ``radcal``, named without ``radcal.``."""
    files = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for path in root.rglob("*.py")
    }

    def imported(node):
        if isinstance(node, ast.Import):
            yield from (item.name for item in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import of {node.module}: imports name the whole module"
            for item in node.names:
                whole = f"{node.module}.{item.name}"
                yield whole if whole.removeprefix("radcal.") in files else str(node.module)

    return frozenset(
        (module, name.removeprefix("radcal."))
        for module, path in files.items()
        for node in ast.walk(ast.parse(path.read_text()))
        for name in imported(node)
        if name.startswith("radcal.") and name != f"radcal.{module}"
    )


def room(module):
    """Package or top-level module that a module belongs to."""
    return module.partition(".")[0]


def circle(edges):
    """Names along one circle, empty if there is none."""
    graph = {}
    for importer, name in edges:
        graph.setdefault(importer, set()).add(name)
    try:
        TopologicalSorter({key: sorted(graph[key]) for key in sorted(graph)}).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def step(module):
    """Place of a module in the flow, None if it serves several steps."""
    found = [
        (len(name), place)
        for place, (_, names) in enumerate(FLOW)
        for name in names
        if f"{module}.".startswith(f"{name}.")
    ]
    return max(found)[1] if found else None


def faults(edges):
    """Sentences on circles of modules, circles of rooms, and imports against the flow."""
    found = [f"circle of modules: {' -> '.join(names)}"] if (names := circle(edges)) else []
    rooms = {(room(a), room(b)) for a, b in edges if room(a) != room(b)}
    found += [f"circle of rooms: {' -> '.join(names)}"] if (names := circle(rooms)) else []
    for importer, name in sorted(edges):
        a, b = step(importer), step(name)
        if a is not None and b is not None and b > a:
            found.append(f"against the flow: {importer} ({FLOW[a][0]}) imports {name} ({FLOW[b][0]})")
    return found


def test_imports_follow_the_flow_and_make_no_circle():
    edges = imports(SOURCE)
    assert ("calibration.steps", "proposals.search") in edges
    assert len(edges) > 300
    assert faults(edges) == []


def test_every_step_of_the_flow_has_its_modules():
    modules = {name for edge in imports(SOURCE) for name in edge}
    missing = [name for _, names in FLOW for name in names if not any(f"{m}.".startswith(f"{name}.") for m in modules)]
    assert missing == [], "moved or renamed: name them as they are called now"


def test_the_page_on_architecture_names_every_room():
    page = (SOURCE.parents[1] / "docs/architecture.md").read_text(encoding="utf-8")
    text = " ".join(page.split("## The rooms")[1].split("Imports follow the flow")[0].split())
    first = re.findall(r"(?:- |; )((?:`\w+/?`(?:, )?)+):", text)
    named = {name for names in first for name in re.findall(r"`(\w+)/?`", names)}
    rooms = {path.stem for path in SOURCE.iterdir() if not path.name.startswith("_") and path.suffix in ("", ".py")}
    assert rooms - named == set(), "rooms without a word in docs/architecture.md"
    assert named - rooms == set(), "rooms that are gone"


def test_a_folder_has_at_most_twelve_modules():
    counts = {
        path: sum(one.stem != "__init__" for one in path.glob("*.py")) for path in SOURCE.iterdir() if path.is_dir()
    }
    assert [path.name for path, count in counts.items() if count > 12] == []


LATE = {"scene/model.py": "import radcal.records", "records.py": "def f():\n    from radcal.scene import model"}
BACK = {"radar/image.py": "try:\n    from radcal import results\nexcept ImportError: ...", "results/__init__.py": ""}


@pytest.mark.parametrize(
    ("written", "sentences"),
    [
        (LATE, ["circle of modules: records -> scene.model -> records",
                "circle of rooms: records -> scene -> records"]),
        (BACK, ["against the flow: radar.image (geometry and image formation) imports results (report)"]),
    ],
)  # fmt: skip
def test_circles_and_steps_back_are_found(written, sentences, tmp_path):
    for name, text in written.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    assert faults(imports(tmp_path)) == sentences
