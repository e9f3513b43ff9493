"""Forward run of a case with given materials, without a measurement: simulated images, incidence and masks."""

from __future__ import annotations

import contextlib
import math
import pkgutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError, RadcalError, SceneError
from radcal.figures.map_figures import gray_scale
from radcal.findings import Finding
from radcal.products import PRODUCTS
from radcal.products.export import ground_layers
from radcal.products.geotiff import Layer, of_pass, write_layers
from radcal.products.tables import aligned, write_csv
from radcal.radar.geometry import Geometry, write_geometry
from radcal.radar.projection import make_geometry
from radcal.reading.rasters import open_raster
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.sections.errors import nearest
from radcal.seeds import noise_seed
from radcal.signals.sicd import write_sicd
from radcal.simulators.forward import Forward, write_complex
from radcal.simulators.runner import Runner, runners_of
from radcal.storage.files import digest
from radcal.storage.records import provenance
from radcal.storage.runs import RunStore
from radcal.words import sentence


def forward(
    case: Part,
    folder: str | Path,
    runs: str | Path,
    check: Callable[[Sequence[str]], None] = lambda _: None,
    product: str = "intensity",
) -> tuple[Scene, list[Forward]]:
    """Simulate all passes of a case at the parameters of its materials, with the noise seed of the final check run.

    Parameters
    ----------
    case : Part
        Scene, passes, simulator and materials. A material to be calibrated has its starting parameters.
    folder : path
        Folder of ``scene.h5``, and of the geometry of each pass, ``passes/<p>/geometry.h5``.
    runs : path
        Folder of the run store; a run that has a record there is not simulated.
    check : callable
        Function that receives the hash of the run of each pass before any file is written, and may raise an error.
    product : str
        Product that is made afterwards (:data:`~radcal.products.PRODUCTS`), whose needs are checked first.

    Returns
    -------
    scene : Scene
        Scene of the case.
    passes : list of Forward
        Passes in their order.

    Raises
    ------
    RadcalError
        The scene cannot be made, the simulator fails, or a file cannot be written.
    """
    folder, started = Path(folder), case.at_start
    with provenance(case.case, case.sections(*type(case).model_fields)):
        scene = make_scene(case.scene, None, case.radar.heading_deg)
        if wrong := [name for name in case.materials if name not in scene.names]:
            texts = (f"materials.{name}: not in the scene{nearest(name, scene.names)}." for name in wrong)
            raise SceneError("\nradcal: ".join(texts))
        scene.require(list(case.materials))
        asked = PRODUCTS[product]
        if asked is not None and asked.check is not None:
            for one in started.passes:
                pkgutil.resolve_name(asked.check)(one, scene)
        geometries = [make_geometry(scene, one.radar) for one in case.passes]
        paths = [folder / f"passes/{number}/geometry.h5" for number in range(1, len(geometries) + 1)]
        runners, seed = runners_of(started, scene, geometries, paths, runs), noise_seed(case, fresh=True)
        keys = [digest(each.description(case.start_parameters, seed)) for each in runners]
        if asked is not None:
            runners[0].require_looks(product)
        check(keys)
        scene.write(folder / "scene.h5")
        for path, geometry, one in zip(paths, geometries, case.passes, strict=True):
            write_geometry(path, geometry, one.radar)
        found = _images(started, runners, scene, geometries, RunStore(runs))
    return scene, found


def _images(
    started: Part, runners: Sequence[Runner], scene: Scene, geometries: Sequence[Geometry], store: RunStore
) -> list[Forward]:
    """Forward runs of all passes."""
    seed, found = noise_seed(started, fresh=True), []
    for each, one, geometry in zip(runners, started.passes, geometries, strict=True):
        x = one.start_parameters
        kept = store.get(digest(each.description(x, seed)), started.calibrated, image=True) is not None
        record = each.run(x, seed, image=True)
        assert record.image_db is not None  # noqa: S101 - asked for
        looks = partial(each.looks, x, seed)
        found.append(Forward(one, scene, geometry, record.image_db, record.key, seed, kept, looks))
    return found


def simulate(
    case: Part,
    folder: str | Path,
    runs: str | Path,
    replace: bool = False,
    product: str = "intensity",
    members: Sequence[Part] = (),
) -> list[str]:
    """Simulate all passes of a case, and write the images as GeoTIFF.

    Parameters
    ----------
    case, folder, runs
        As for :func:`forward`. ``folder`` receives ``simulated.tif``, ``incidence.tif``, ``material.tif`` and
        ``mask.tif``, and the files of the product, which have its name; from pass 2 on, the file names of pass p end
        in ``_pass<p>``.
    replace : bool
        Whether images of other runs in the folder are replaced.
    product : str
        What is written beside the images, by its name in :data:`~radcal.products.PRODUCTS`.
    members : sequence of Part
        The case with other laws (:func:`.applied.members_of`), each of which is simulated, too, with the same random
        numbers; ``docs/predictions.md`` describes its files.

    Returns
    -------
    list of str
        Lines on the simulated passes, and the paths of the images.

    Raises
    ------
    ConfigError
        The folder has the image of another run, and ``replace`` is false. No file was written then.
    RadcalError
        As for :func:`forward`.
    """
    folder = Path(folder)

    def check(keys: Sequence[str]) -> None:
        if replace:
            return
        for number, key in enumerate(keys, start=1):
            path = folder / f"simulated{of_pass(number)}.tif"
            if not path.exists():
                continue
            former = None
            with contextlib.suppress(RadcalError, OSError), open_raster(path) as raster:
                former = raster.tags().get("run")
            if former != key:
                run = "is no readable image of a run" if former is None else f"is the image of run {former}"
                raise ConfigError(
                    f"{path}: {run}, and not of run {key}, which differs in laws, scene, pass, seed or simulator: give "
                    "--replace to replace it, or --out with another folder."
                )

    scene, passes = forward(case, folder, runs, check, product)
    lines = [sentence(one) for one in scene.findings]
    for number, (one, made) in enumerate(zip(case.passes, passes, strict=True), start=1):
        tags = {"case": case.case, "radiometry": one.radar.radiometry, "run": made.key}
        layers = {
            "simulated": Layer(made.image_db, "dB", "simulated image", tags, gray=gray_scale(made.image_db)),
            **ground_layers(made.geometry, tags, case.materials),
        }
        how = "was in the run store" if made.kept else "simulated"
        lines.append(f"pass {number}: {made.image_db.shape[0]} x {made.image_db.shape[1]} pixels, run {made.key} {how}")
        made_files: list[Path | Finding] = [*write_layers(folder, number, layers, scene, made.geometry)]
        made_files += _product(product, folder, number, made)
        lines += [sentence(one) if isinstance(one, Finding) else f"  {one}" for one in made_files]
    return [*lines, *_spread(folder, runs, passes, members, product)] if members else lines


def _product(product: str, folder: Path, number: int, made: Forward) -> list[Path | Finding]:
    """Write the files of a product of a pass; gives them, and findings."""
    asked = PRODUCTS[product]
    return [] if asked is None else pkgutil.resolve_name(asked.write)(folder / f"{product}{of_pass(number)}", made)


def _spread(
    folder: Path, runs: str | Path, passes: Sequence[Forward], members: Sequence[Part], product: str
) -> list[str]:
    """Simulate members, write the files of each and quantiles of their images; gives a table of what they report."""
    scene, geometries, names = passes[0].scene, [one.geometry for one in passes], list(passes[0].case.materials)
    paths = [folder / f"passes/{number}/geometry.h5" for number in range(1, len(passes) + 1)]
    images: list[list[NDArray[np.float32]]] = [[] for _ in passes]
    rows: list[dict[str, float | str]] = []
    for k, member in enumerate(members, start=1):
        runners = runners_of(member, scene, geometries, paths, runs)
        for number, made in enumerate(_images(member, runners, scene, geometries, RunStore(runs)), start=1):
            images[number - 1].append(made.image_db)
            found = _product(product, folder / f"draws/{k}", number, made)
            rows.append({"pass": number, "member": k, "run": made.key})
            for name in names:
                power = 10.0 ** (made.image_db.ravel()[made.geometry.pixels(name)].astype(np.float64) / 10.0)
                rows[-1][f"{name}_db"] = float(10.0 * np.log10(power.mean())) if power.size else math.nan
            for one in found:
                rows[-1] |= one.numbers if isinstance(one, Finding) and one.about == product else {}
    table: list[Sequence[str]] = [("pass", "number", "5 %", "median", "95 %")]
    files = [folder / "draws.csv"]
    for number, (made, each) in enumerate(zip(passes, images, strict=True), start=1):
        low, high = np.quantile(np.stack(each), [0.05, 0.95], axis=0).astype(np.float32)
        tags = {"case": made.case.case, "members": str(len(members))}
        layers = {
            "simulated_p05": Layer(low, "dB", "5 % quantile of the images of the members", tags),
            "simulated_p95": Layer(high, "dB", "95 % quantile of the images of the members", tags),
        }
        files += write_layers(folder, number, layers, scene, made.geometry)
        its = [row for row in rows if row["pass"] == number]
        for key in list(its[0])[3:]:
            quantiles = np.quantile([float(row[key]) for row in its], [0.05, 0.5, 0.95])
            table.append((str(number), key, *(f"{value:.3g}" for value in quantiles)))
    write_csv(files[0], tuple(rows[0]), (tuple(row.values()) for row in rows))
    return [f"{len(members)} members of the posterior:", *aligned(table), *(f"  {file}" for file in files)]


def write_looks(stem: Path, made: Forward) -> list[Path | Finding]:
    """Write the complex looks of a pass to an HDF5 file, and as SICD.

    Parameters
    ----------
    stem : path
        Path of the file without its suffix.
    made : Forward
        Forward run of the pass.

    Returns
    -------
    list of path or Finding
        The files (:func:`.sicd.write_sicd`).
    """
    phases = (
        "random, independent in each look and in each pixel before the impulse response: they hold neither the "
        "range to the ground nor an interferometric phase"
    )
    path = stem.with_suffix(".h5")
    write_complex(path, made, "complex", made.looks(), math.ceil(made.case.radar.looks), phases)
    return [path, *write_sicd(stem, made, made.looks(), apart=False)]
