"""New case file: the template, filled with the values of options and with what the input files say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from radcal.bands import WIDTH_FACTOR, letter_band
from radcal.config import Uncertainty
from radcal.config.loading import Loaded
from radcal.config.writing import inline
from radcal.errors import ConfigError
from radcal.image.acquisition import radar_keys
from radcal.newcase.file_facts import (
    POLARISATIONS,
    RasterFacts,
    code_counts,
    product_acquisition,
    raster_facts,
    value_counts,
)
from radcal.newcase.new_materials import fixed_laws, new_materials
from radcal.newcase.template import TEMPLATE
from radcal.reading.base import reader_of
from radcal.reading.vectors import ENDINGS
from radcal.scene.names import read_names
from radcal.sections.base import FILL_IN, check_case_name, with_undecided
from radcal.storage.files import atomic
from radcal.tables.landcover import landcovers
from radcal.tables.sensors import Sensor, sensors
from radcal.vectors.mapping import VectorMapping, read_mapping

_INCIDENCE_DEG, _SAMPLING = 45.0, 1.4  # of the default pass: incidence, and resolution over pixel spacing
_SYNTHETIC, _NONE = "synthetic", "none"  # words in place of the path of a measured image
_NOT_ON_THE_MAP = {"scene.labels", "scene.near_incidence_deg", "scene.far_incidence_deg"}
_NOT_IN_SLANT_RANGE = {
    "scene.elevation", "scene.materials", "scene.vertical_datum",
    "radar.altitude_m", "radar.depression_deg", "radar.look_side", "radar.heading_deg",
}  # fmt: skip


def case_path(case: str) -> Path:
    """Path of a new case file: a path that ends in .yaml as typed, else ``<case>.yaml``, in ``config`` if it exists."""
    path = Path(case)
    if path.suffix.lower() in (".yaml", ".yml"):
        return path
    folder = Path("config") if len(path.parts) == 1 and Path("config").is_dir() else path.parent
    return folder / f"{path.name}.yaml"


class NewCase:
    """New case file, with its content and its path.

    Parameters
    ----------
    path : path
        Case file to be written.
    given : mapping
        Values by key, such as ``radar.looks``; ``measurement.path`` may be ``synthetic`` or ``none``.

    Attributes
    ----------
    forward : bool
        Whether the case is for ``radcal simulate`` alone, without a measured image.
    text : str
        Case in YAML, with its comments.
    undecided : list of str
        Keys without a value, whose lines are marked.

    Raises
    ------
    ConfigError
        The case file exists, its name is no valid case name, or an input file cannot be read; or the configuration
        refuses the case: the message then has one line for each mistake.
    """

    def __init__(self, path: Path, given: Mapping[str, Any]) -> None:
        _refuse_existing(path, "type another name")
        check_case_name(path.stem, str(path))
        self.path = path
        self._values = dict(given)
        self._comments: dict[str, str] = {}
        self._unneeded: set[str] = set()  # keys of the template without which the case is complete
        chosen, fixed = (self._values.pop(f"materials.{key}", []) for key in ("calibrated", "fixed"))
        image = self._values.get("measurement.path", "")
        self.forward = image == _NONE
        self._made_up: dict[Path, str] = {}  # content of the file of names, if none was given
        heights = self._facts("scene.elevation")
        of_cover = self._read_scene(heights)
        levels_db = None
        if image in (_NONE, _SYNTHETIC):
            self._invent_image(heights)
        elif reader_of(image).gives_acquisition:
            self._read_product()
        else:
            levels_db = self._read_file()
        if self.forward and (unused := [*(key for key in self._values if key.startswith("measurement.")), *chosen]):
            raise ConfigError(f"{unused[0]} is given, and --image none makes a case without a measured image.")
        preset = self._values.get("scene.landcover")
        materials, about, hidden = new_materials(
            of_cover, chosen, fixed_laws(fixed), preset, not self.forward, levels_db
        )
        if image == _SYNTHETIC:
            self._values["measurement.synthetic"] = {"parameters": hidden}
        self._complete()
        self.undecided: list[str] = []
        case = {**self._filled(), "materials": materials}
        if any(FILL_IN in material.get("parameters", ()) for material in materials.values()):
            self.undecided.append("materials.fixed")
        # the file of names need not exist yet
        checked = {**case, "scene": {**case["scene"], "names": "names.json"}}
        loaded = Loaded(dict(with_undecided(checked)))
        found = [f"{one.text}." for one in loaded.mistakes if not (one.undecided or loaded.forward)]
        if found:
            raise ConfigError("\nradcal: ".join(found))
        self.text = "# Written by radcal new. Every other key has a default (config/config.yaml).\n"
        if self.undecided:
            self.text += f"# Write a value in place of each {FILL_IN}, as its comment says; radcal check lists them.\n"
        self.text += "\n".join(_lines({"case": path.stem, **case}, self._comments | about)) + "\n"

    def write(self) -> list[str]:
        """Write the case, and the names of the codes if no file of names was given.

        Returns
        -------
        list of str
            Sentences about the files that were written.
        """
        for path, text in {**self._made_up, self.path: self.text}.items():
            with atomic(path) as partial:
                partial.write_text(text, "utf-8")
        made_up = [f"{path}: names of materials, made up: change them there and in the case." for path in self._made_up]
        return [*made_up, f"{self.path}: written."]

    def _path(self, key: str) -> Path:
        return Path(self._values[key]).expanduser()

    def _facts(self, key: str, numbers: bool = False) -> RasterFacts | None:
        facts = raster_facts(self._path(key), key, numbers) if key in self._values else None
        if facts is not None:
            self._comments[key] = str(facts)
        return facts

    def _of_radar(self) -> dict[str, Any]:
        return {key.removeprefix("radar."): x for key, x in self._values.items() if key.startswith("radar.")}

    @property
    def _sensor(self) -> Sensor | None:
        return sensors().get(self._values.get("radar.sensor", ""))

    def _read_scene(self, heights: RasterFacts | None) -> dict[str, str]:
        """Section ``scene``; returns a comment on each material of the land cover."""
        if heights is not None and heights.datum is not None:
            self._comments["scene.elevation"] += f", heights above {heights.datum}"
            self._unneeded.add("scene.vertical_datum")
        elif self.forward:  # what the heights refer to matters only to a measured image
            self._values["scene.vertical_datum"] = "local"
        if Path(self._values.get("scene.materials", "")).suffix.lower() in ENDINGS:
            return self._read_features()
        cover = self._facts("scene.materials")
        path = None if cover is None else self._path("scene.materials")
        slant = cover is not None and cover.crs is None and heights is None
        self._values["scene.source"] = "slant_range" if slant else "raster"
        self._unneeded |= _NOT_IN_SLANT_RANGE if slant else _NOT_ON_THE_MAP
        if slant:
            self._values["scene.labels"] = self._values.pop("scene.materials")
            self._comments["scene.labels"] = str(cover)
        counts = {} if path is None else {code: count for code, count in code_counts(path).items() if code != 0}
        if path is None or not counts:
            return {}
        preset = landcovers().get(self._values.get("scene.landcover", ""))
        if "scene.names" in self._values:
            names = read_names(self._path("scene.names"), counts, path)
        elif preset is not None:
            if unknown := ", ".join(str(code) for code in counts if code not in preset):
                raise ConfigError(f"scene.landcover: the map has no code {unknown} of {path}, expected --names.")
            self._unneeded.add("scene.names")
            names = {code: preset[code].name for code in counts}
        else:
            if fits := ", ".join(name for name, codes in landcovers().items() if codes.keys() >= counts.keys()):
                self._comments["scene.names"] = f"maps with these codes (--landcover-preset): {fits}"
            names = {code: f"code_{code}" for code in counts}
            self._make_up("json", json.dumps(names, indent=1) + "\n")
        total = sum(counts.values())
        present = {code: name for code, name in names.items() if code in counts}
        return {name: f"code {code}: {counts[code]:,} of {total:,} pixels" for code, name in present.items()}

    def _read_features(self) -> dict[str, str]:
        """Section ``scene`` with a land cover of vectors; returns a comment on each material."""
        self._values["scene.source"] = "vectors"
        self._unneeded |= _NOT_ON_THE_MAP
        if "scene.names" in self._values:
            mapping = read_mapping(self._path("scene.names"), "scene.names", VectorMapping)
            return dict.fromkeys(mapping.names.values(), "of the mapping")
        attribute, counts = value_counts(self._path("scene.materials"))
        surfaces = {f"{attribute}={value}": _material(value) for value in counts}
        self._comments["scene.names"] = f"a material for each value of the attribute {attribute} (docs/vectors.md)"
        self._make_up("yaml", yaml.safe_dump({"surfaces": surfaces}, sort_keys=False, allow_unicode=True))
        total = sum(counts.values())
        return {_material(value): f"{value}: {count:,} of {total:,} features" for value, count in counts.items()}

    def _make_up(self, ending: str, text: str) -> None:
        """Have a file of names written beside the case."""
        beside = self.path.with_name(f"{self.path.stem}_names.{ending}")
        _refuse_existing(beside, "give it with --names")
        self._values["scene.names"] = str(beside)
        self._made_up[beside] = text

    def _invent_image(self, heights: RasterFacts | None) -> None:
        """Sections of a case without a measured image, of which the defaults are as good as any."""
        word = self._values.pop("measurement.path")
        if word == _SYNTHETIC:
            self._values["measurement.source"] = word
        self._unneeded |= {key for key in TEMPLATE if key.startswith(("measurement.", "radar."))}
        if not (self._sensor and "range_spacing_m" in self._sensor.values):
            self._set_spacing(heights, "the cells", _INCIDENCE_DEG)
        for way in ("range", "azimuth"):
            if (spacing := self._values.get(f"radar.{way}_spacing_m")) is not None:
                self._values.setdefault(f"radar.{way}_resolution_m", float(f"{_SAMPLING * spacing:.4g}"))

    def _read_product(self) -> None:
        """Section ``radar`` from the acquisition in the file of the image, for the scene's heights."""
        self._unneeded |= {"measurement.band", "measurement.scale", "measurement.radiometry"}
        if "scene.elevation" not in self._values:
            return
        heights = self._path("scene.elevation")
        found = product_acquisition(self._path("measurement.path"), heights, self._values.get("radar.polarisation"))
        if found is None:
            return
        self._comments["measurement.path"] = f"{found.sensor}, {found.pass_direction}, {found.start}"
        for key, (value, remark) in radar_keys(found).items():
            of_other = key == "incidence_deg" and "radar.depression_deg" in self._values
            if not of_other and f"radar.{key}" not in self._values:
                self._values[f"radar.{key}"] = value
                self._comments[f"radar.{key}"] = "of the product" + f"; {remark}" * bool(remark)

    def _read_file(self) -> tuple[float, float, float] | None:
        """Band, scale, polarisation and pixel spacing of an image in a file; returns its levels [dB], if known."""
        facts, band = self._facts("measurement.path", numbers=True), self._values.get("measurement.band")
        if facts is None or len(facts.bands) == 1:
            self._unneeded.add("measurement.band")
        if facts is None:
            return None
        if band is None and len(facts.bands) == 1:
            band = 1
        elif band is None and (wanted := self._values.get("radar.polarisation")) in facts.bands:
            band = self._values["measurement.band"] = facts.bands.index(wanted) + 1
        listed = ", ".join(f"{k} {name or 'without a name'}" for k, name in enumerate(facts.bands, start=1))
        self._comments["measurement.band"] = f"bands of the file: {listed}"
        if (scale := facts.scale(band)) is not None:
            self._values.setdefault("measurement.scale", scale)
        if band is None:
            return None
        if not 1 <= band <= len(facts.bands):
            path = self._values["measurement.path"]
            raise ConfigError(f"measurement.band is {band}, {path} has {len(facts.bands)}, counted from 1.")
        if facts.bands[band - 1] in POLARISATIONS:
            self._values.setdefault("radar.polarisation", facts.bands[band - 1])
        self._set_spacing(facts, "the image's pixels")
        levels_db = facts.levels_db(band, self._values.get("measurement.scale"))
        if levels_db is not None:
            low, middle, high = levels_db
            self._comments["measurement.scale"] = f"levels of {low:.3g} to {high:.3g} dB, median {middle:.3g} dB"
        return levels_db

    def _set_spacing(self, facts: RasterFacts | None, of: str, otherwise_deg: float | None = None) -> None:
        """Set the pixel spacings with which simulated pixels are as large as the pixels of a raster on the map."""
        if facts is None or facts.pixel_m is None:
            return
        radar = self._of_radar()
        depression_deg = radar.get("depression_deg")
        incidence_deg = radar.get("incidence_deg", otherwise_deg if depression_deg is None else 90.0 - depression_deg)
        east, north = facts.pixel_m
        sensor = {} if self._sensor is None else self._sensor.values_at(incidence_deg or _INCIDENCE_DEG)
        pixels = {"range": east * math.sin(math.radians(incidence_deg or _INCIDENCE_DEG)), "azimuth": north}
        # an image whose pixels are too large for the sensor's resolution was resampled: the sensor's spacing stays
        if any(
            f"{way}_spacing_m" in sensor and size * WIDTH_FACTOR > sensor.get(f"{way}_resolution_m", math.inf)
            for way, size in pixels.items()
        ):
            return
        notes = {"azimuth": f"as {of}", "range": f"{of} of {east:.4g} m times the sine of the incidence"}
        for way, note in notes.items():
            if f"{way}_spacing_m" not in radar:
                self._comments[f"radar.{way}_spacing_m"] = note
                if way == "azimuth" or incidence_deg is not None:
                    self._values[f"radar.{way}_spacing_m"] = float(f"{pixels[way]:.4g}")

    def _complete(self) -> None:
        """Keys that follow from the others, and those that a sensor leaves open."""
        frequency, source = self._values.get("radar.frequency_ghz"), self._values["scene.source"]
        if frequency is not None and (letter := letter_band(frequency * 1e9)) is not None:
            self._values.setdefault("radar.band", letter)
        if "radar.incidence_deg" in self._values:
            self._unneeded.add("radar.depression_deg")
        if self._sensor is not None:
            self._unneeded |= {f"radar.{key}" for key in (*self._sensor.values, "depression_deg", "frequency_ghz")}
            track = ["heading_deg"] if self._sensor.orbit and source == "raster" else []
            for key in [*self._sensor.missing(self._of_radar()), *track]:
                self._values.setdefault(f"radar.{key}", FILL_IN)
        if "measurement.path" not in self._unneeded:
            self._values |= {"measurement.source": "file", "uncertainty.level_db": Uncertainty().level_db}
            if "measurement.radiometry" not in self._unneeded:
                self._values["measurement.radiometry"] = self._values.get("radar.radiometry", FILL_IN)

    def _filled(self) -> dict[str, dict[str, Any]]:
        """Sections of the template with their values, and with comments on each line."""
        filled = dict[str, dict[str, Any]]()
        for key, line in TEMPLATE.items():
            section, _, name = key.partition(".")
            value = self._values.get(key, FILL_IN if line.needed and key not in self._unneeded else None)
            if value is None:
                continue
            filled.setdefault(section, {})[name] = value
            read = self._comments.get(key, "")
            parts = [line.comment if value == FILL_IN or not read else "", read]
            if value == FILL_IN:
                self.undecided.append(key)
            self._comments[key] = "; ".join(part for part in parts if part)
        return filled


def _material(value: str) -> str:
    """Name of a material from the value of an attribute."""
    name = re.sub(r"\W+", "_", value.lower()).strip("_")
    return name if name[:1].isalpha() else f"class_{name}"


def _refuse_existing(path: Path, remedy: str) -> None:
    if path.exists():
        raise ConfigError(f"{path}: exists, and radcal new overwrites nothing: {remedy}.")


def _lines(data: Mapping[str, Any], comments: Mapping[str, str], above: str = "", indent: str = "") -> list[str]:
    """Lines in YAML: one for each key with its comment, and below it those of a section."""
    lines = []
    for key, value in data.items():
        place, section = f"{above}{key}", isinstance(value, dict) and value
        text = f"{indent}{inline(key)}:" + ("" if section else f" {inline(value)}")
        lines.append(text + (f"  # {comments[place]}" if comments.get(place) else ""))
        if section:
            lines += _lines(value, comments, f"{place}.", f"{indent}  ")
    return lines
