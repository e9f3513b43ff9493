"""New case file in commented YAML: a template with the values of options and the properties of the input files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radcal.bands import WIDTH_FACTOR, letter_band
from radcal.config import FILL_IN, Uncertainty, load_with_problems
from radcal.config.undecided import EXAMPLES, Undecided
from radcal.config.yaml_file import read_value
from radcal.errors import ConfigError
from radcal.image.acquisition import radar_keys
from radcal.newcase.file_facts import RasterFacts, code_counts, product_acquisition, raster_facts
from radcal.newcase.new_materials import Raw, fixed_laws, material_lines, scalar
from radcal.reading.safe import is_safe_name
from radcal.scene.names import read_names
from radcal.sections.base import check_case_name
from radcal.storage.files import atomic
from radcal.tables.landcover import LANDCOVERS
from radcal.tables.sensors import SENSORS

__all__ = ["NewCase", "case_path"]

_DEPRESSION_DEG, _SAMPLING = 45.0, 1.4  # of the default pass: depression, and resolution over pixel spacing
_SYNTHETIC, _NONE = "synthetic", "none"  # words in place of the path of a measured image
_HIDDEN = (
    " # hidden laws, which the calibration is to find: drawn by the seed of the default case, another one for each "
    "material, about the level of its start"
)
_OF_FILES = (  # the remark on a given file describes the file's content instead of the key
    "scene.elevation", "scene.materials", "scene.labels", "measurement.path", "measurement.band", "measurement.scale",
)  # fmt: skip


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
    texts : mapping
        Description of each key, for the comments; the order of the keys is that of the lines in section ``radar``.
    optional : set of str
        Keys whose default is right in most cases.

    Attributes
    ----------
    undecided : list of str
        Keys without a value, whose lines are marked.

    Raises
    ------
    ConfigError
        The case file exists, its name is no valid case name, or an input file cannot be read; or the configuration
        refuses the case: the message then has one line for each mistake.
    """

    def __init__(self, path: Path, given: Mapping[str, Any], texts: Mapping[str, str], optional: set[str]) -> None:
        if path.exists():
            raise ConfigError(f"{path}: exists, and radcal new overwrites nothing: type another name.")
        check_case_name(path.stem, str(path))
        self.path, self.name, self._texts, self._optional = path, path.stem, texts, optional
        self._values = {"scene.source": "raster", **given}
        self._given = list(given)
        self._notes: dict[str, str] = {}
        self._names: dict[int, str] = {}
        self._counts: dict[int, int] = {}
        self._levels_db: tuple[float, float, float] | None = None
        self._heights = self._facts("scene.elevation")
        self._read_scene()
        self._read_image()
        frequency, looks = self._values.get("radar.frequency_ghz"), self._values.get("radar.looks")
        if frequency is not None and (letter := letter_band(frequency * 1e9)) is not None:
            self._values.setdefault("radar.band", letter)
        if looks is not None and float(looks).is_integer():
            self._values["radar.looks"] = int(looks)
        self._materials, self.undecided = self._material_lines()
        sections = ("scene", "radar") if self.forward else ("scene", "measurement", "radar")
        self._sections = {name: getattr(self, f"_{name}_keys")() for name in sections}
        for section, keys in self._sections.items():
            self.undecided += [f"{section}.{key}" for key in keys if f"{section}.{key}" not in self._values]
        # the name of the case is checked above, with its path
        data = {key: value for key, value in read_value(self._text(), "radcal new").items() if key != "case"}
        found = [one for one in load_with_problems([], data).found if not isinstance(one.about, Undecided)]
        if found:
            raise ConfigError("\nradcal: ".join(str(one).removeprefix("configuration: ") for one in found))

    @property
    def forward(self) -> bool:
        """Whether the case is for ``radcal simulate`` alone, without a measured image."""
        return self._values.get("measurement.path") == _NONE

    @property
    def _synthetic(self) -> bool:
        return self._values.get("measurement.path") == _SYNTHETIC

    @property
    def _slant(self) -> bool:
        return bool(self._values["scene.source"] == "slant_range")

    def _path(self, key: str) -> Path:
        return Path(self._values[key]).expanduser()

    def _facts(self, key: str, numbers: bool = False) -> RasterFacts | None:
        facts = raster_facts(self._path(key), key, numbers) if key in self._values else None
        if facts is not None:
            self._notes[key] = facts.sentence()
        return facts

    def _read_scene(self) -> None:
        if self._heights is not None and self._heights.datum is not None:
            self._notes["scene.elevation"] += f", heights above {self._heights.datum}"
            self._values.setdefault("scene.vertical_datum", "")  # known from the file: no line is needed
        elif self.forward:  # what the heights refer to matters only to a measured image
            self._values["scene.vertical_datum"] = "local"
        cover = self._facts("scene.materials")
        if cover is None:
            return
        if cover.crs is None and self._heights is None:
            self._values |= {"scene.source": "slant_range", "scene.labels": self._values["scene.materials"]}
            self._notes["scene.labels"] = self._notes["scene.materials"]
        path = self._path("scene.materials")
        self._counts = {code: count for code, count in code_counts(path).items() if code != 0}
        self._names = {code: f"code_{code}" for code in self._counts}
        preset = LANDCOVERS.get(self._values.get("scene.landcover", ""))
        if "scene.names" in self._values:
            self._names = read_names(self._path("scene.names"), self._counts, path)
        elif preset is not None:
            if unknown := [str(code) for code in self._counts if code not in preset]:
                codes = ", ".join(unknown)
                raise ConfigError(f"scene.landcover: the map has no code {codes} of {path}, expected --names.")
            self._names = {code: preset[code].name for code in self._counts}
            self._values["scene.names"] = ""  # known from the preset: no line is needed
        elif fits := [name for name, codes in LANDCOVERS.items() if codes.keys() >= self._counts.keys()]:
            self._notes["scene.names"] = f"maps with these codes (--landcover-preset): {', '.join(fits)}"

    def _read_image(self) -> None:
        self._values["measurement.source"] = "file"
        if self._synthetic or self.forward:
            self._values["measurement.source"] = self._values["measurement.path"]
            sensor = SENSORS.get(self._values.get("radar.sensor", ""))
            if self._heights is not None and not (sensor and "range_spacing_m" in sensor.values):
                self._note_spacing(self._heights, "cells", _DEPRESSION_DEG)
            for way in ("range", "azimuth"):
                if (spacing := self._values.get(f"radar.{way}_spacing_m")) is not None:
                    self._values.setdefault(f"radar.{way}_resolution_m", float(f"{_SAMPLING * spacing:.4g}"))
        elif is_safe_name(self._values.get("measurement.path", "")):
            self._read_product()
        else:
            self._read_file()

    def _read_product(self) -> None:
        """Fill section ``radar`` from the annotation of a SAFE folder, computed for the scene's heights."""
        for key in ("band", "scale", "radiometry"):
            self._values.setdefault(f"measurement.{key}", "")
        if "scene.elevation" not in self._values:
            return
        path, polarisation = self._path("measurement.path"), self._values.get("radar.polarisation")
        if not path.exists():
            raise ConfigError(f"measurement.path: the folder {path} does not exist.")
        found = product_acquisition(path, self._path("scene.elevation"), polarisation)
        self._notes["measurement.path"] = f"{found.sensor}, {found.pass_direction}, {found.start}"
        for key, (value, remark) in radar_keys(found).items():
            other = "radar.depression_deg" if key == "incidence_deg" else ""
            if f"radar.{key}" not in self._given and other not in self._given:
                self._values[f"radar.{key}"] = Raw(str(value)) if isinstance(value, list) else value
                self._notes[f"radar.{key}"] = "; ".join(text for text in ("of the product", remark) if text)

    def _read_file(self) -> None:
        """Band, scale, polarisation, pixel spacing and levels of an image in a raster."""
        facts = self._facts("measurement.path", numbers=True)
        band = self._values.get("measurement.band")
        if facts is None or len(facts.bands) == 1:
            self._values.setdefault("measurement.band", "")  # the only band: no line is needed
        if facts is None:
            return
        if len(facts.bands) == 1:
            band = band or 1
        elif band is None and (wanted := self._values.get("radar.polarisation")) in facts.bands:
            band = self._values["measurement.band"] = facts.bands.index(wanted) + 1
        listed = ", ".join(f"{k} {name or 'without a name'}" for k, name in enumerate(facts.bands, start=1))
        self._notes["measurement.band"] = f"bands of the file: {listed}"
        if (scale := facts.scale(band)) is not None:
            self._values.setdefault("measurement.scale", scale)
        if band is None:
            return
        if not 1 <= band <= len(facts.bands):
            path = self._values["measurement.path"]
            raise ConfigError(f"measurement.band is {band}, {path} has {len(facts.bands)}.")
        if facts.bands[band - 1] in ("HH", "HV", "VH", "VV"):
            self._values.setdefault("radar.polarisation", facts.bands[band - 1])
        self._levels_db = facts.levels_db(band, self._values.get("measurement.scale"))
        if self._levels_db is not None:
            low, middle, high = self._levels_db
            self._notes["measurement.scale"] = f"levels of {low:.3g} to {high:.3g} dB, median {middle:.3g} dB"
        self._note_spacing(facts, "the image's pixels")

    def _note_spacing(self, facts: RasterFacts, of: str, otherwise_deg: float | None = None) -> None:
        """Set the pixel spacings with which simulated pixels are as large as the pixels of a raster on the map."""
        if facts.pixel_m is None:
            return
        east, north = facts.pixel_m
        depression = self._values.get("radar.depression_deg", otherwise_deg)
        if (incidence := self._values.get("radar.incidence_deg")) is not None:
            depression = 90.0 - incidence  # used here as the angle between slant range and level ground
        incidence_deg = 90.0 - (_DEPRESSION_DEG if depression is None else depression)
        sensor = SENSORS.get(self._values.get("radar.sensor", ""))
        known = {} if sensor is None else sensor.values_at(incidence_deg)
        # an image whose pixels are too large for the sensor's resolution was resampled: the sensor's spacing stays
        pixels = {"range": east * math.sin(math.radians(incidence_deg)), "azimuth": north}
        if any(
            f"{way}_spacing_m" in known and size * WIDTH_FACTOR > known.get(f"{way}_resolution_m", math.inf)
            for way, size in pixels.items()
        ):
            return
        notes = {"azimuth": f"as {of}", "range": f"{of} of {east:.4g} m times the cosine of the depression angle"}
        for way, note in notes.items():
            key = f"radar.{way}_spacing_m"
            if key not in self._values:
                self._notes[key] = note
                if way == "azimuth" or depression is not None:
                    self._values[key] = float(f"{pixels[way]:.4g}")

    def _with_given(self, section: str, keys: list[str]) -> list[str]:
        """Keys of a section and those that were given, which the configuration refuses if the section lacks them."""
        given = [key.partition(".")[2] for key in self._given if key.startswith(f"{section}.")]
        return [*keys, *(key for key in given if key not in keys)]

    def _scene_keys(self) -> list[str]:
        if self._slant:
            keys = self._with_given("scene", ["source", "labels", "names", "near_incidence_deg", "far_incidence_deg"])
            return [key for key in keys if key != "materials"]  # they are the labels
        preset = ["landcover"] if "scene.landcover" in self._values else []
        return self._with_given("scene", ["source", "elevation", "materials", *preset, "names", "vertical_datum"])

    def _measurement_keys(self) -> list[str]:
        if self._synthetic:
            return [key for key in self._with_given("measurement", ["source", "synthetic"]) if key != "path"]
        if self._values.get("measurement.radiometry") != "":  # else the product defines it
            self._values["measurement.radiometry"] = self._values.get("radar.radiometry", FILL_IN)
            self._notes["measurement.radiometry"] = "the same as in section radar"
        return self._with_given("measurement", ["source", "path", "band", "scale", "radiometry"])

    def _radar_keys(self) -> list[str]:
        # a land cover in slant range has no track, and of an invented pass the defaults are as good as any
        track = {"radar.altitude_m", "radar.depression_deg", "radar.look_side", "radar.heading_deg"}
        may_lack = self._optional | {"radar.band"} | (track if self._slant else set())
        needed = set[str]()
        if "radar.incidence_deg" in self._values:
            may_lack.add("radar.depression_deg")
        if (sensor := SENSORS.get(self._values.get("radar.sensor", ""))) is not None:
            # keys that the sensor gives are optional; radiometry is not given by a sensor
            may_lack |= {f"radar.{key}" for key in (*sensor.values, "depression_deg", "frequency_ghz")}
            own = {key.removeprefix("radar."): x for key, x in self._values.items() if key.startswith("radar.")}
            needed = {f"radar.{key}" for key in sensor.missing(own)}
            needed |= {"radar.heading_deg"} if sensor.orbit and not self._slant else set()
        invented = self._synthetic or self.forward
        return [
            key.removeprefix("radar.")
            for key in (*self._texts, "radar.band")
            if key.startswith("radar.") and (key in self._values or key in needed or not (invented or key in may_lack))
        ]

    def _material_lines(self) -> tuple[list[str], list[str]]:
        """Lines of section ``materials`` and undecided keys; a synthetic image gets hidden laws of the materials."""
        chosen, preset = self._values.get("materials.calibrated", []), self._values.get("scene.landcover")
        if self.forward and (unused := [key for key in self._given if re.match("measurement.(?!path)", key)] or chosen):
            raise ConfigError(f"{unused[0]} is given, and --image none makes a case without a measured image.")
        fixed = fixed_laws(self._values.get("materials.fixed", []))
        made = material_lines(
            self._names, self._counts, chosen, fixed, preset, not self.forward, levels_db=self._levels_db
        )
        if self._synthetic:
            laws = "".join(f"\n      {scalar(name)}: {x}" for name, x in made.hidden.items()) or " {}"
            self._values["measurement.synthetic"] = Raw(f"{_HIDDEN}\n    parameters:{laws}")
        return made.lines, made.undecided

    def write(self) -> list[str]:
        """Write the case, and the names of the codes if no file of names was given.

        Returns
        -------
        list of str
            Sentences about the files that were written.
        """
        said = []
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self._names and "scene.names" not in self._values:
            names = self.path.with_name(f"{self.name}_names.json")
            if names.exists():
                raise ConfigError(f"{names}: exists, and radcal new overwrites nothing: give it with --names.")
            with atomic(names) as partial:
                partial.write_text(json.dumps({str(k): v for k, v in self._names.items()}, indent=1) + "\n", "utf-8")
            self._values["scene.names"] = str(names)
            self.undecided.remove("scene.names")
            said.append(f"{names}: names of {len(self._names)} codes, made up: change them there and in the case.")
        with atomic(self.path) as partial:
            partial.write_text(self._text(), "utf-8")
        return [*said, f"{self.path}: written."]

    def _text(self) -> str:
        """Case in YAML, with its comments."""
        lines = ["# Written by radcal new. Every other key has a default (config/config.yaml)."]
        if self.undecided:
            lines += [
                f"# Write a value in place of each {FILL_IN}, as the example in its line; radcal check lists them."
            ]
        lines.append(f"case: {self.name}")
        for section, keys in self._sections.items():
            lines.append(f"{section}:" + " {}  # as in config/config.yaml" * (not keys))
            for key in keys:
                name = f"{section}.{key}"
                value = self._values.get(name, FILL_IN)
                if value == "":
                    continue
                told = name in self._notes and name in _OF_FILES
                comment = "" if told else self._texts.get(name, "")
                if name == "scene.names":  # what follows is about the option, not about the key
                    comment = comment.partition(";")[0]
                such = f"for example {key}: {EXAMPLES[name]}" if value == FILL_IN and name in EXAMPLES else ""
                about = "; ".join(text for text in (comment, self._notes.get(name, ""), such) if text)
                lines.append(f"  {key}: {scalar(value)}" + (f"  # {about}" if about else ""))
        if not (self._synthetic or self.forward):
            lines += [
                f"uncertainty:\n  level_db: {Uncertainty().level_db:g}  # standard error of the image's absolute level "
                "[dB], often most of a band; the default is a third of Sentinel-1's 1 dB"
            ]
        return "\n".join([*lines, "materials:", *self._materials]) + "\n"
