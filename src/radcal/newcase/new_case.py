"""New case file in commented YAML, made from the answers of a user and from the properties of the input files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radcal.bands import WIDTH_FACTOR, letter_band
from radcal.config import FILL_IN, Uncertainty
from radcal.config.landcover import LANDCOVERS, landcover_remark
from radcal.config.sections import check_case_name
from radcal.config.sensors import SENSORS
from radcal.config.undecided import EXAMPLES
from radcal.errors import ConfigError
from radcal.image.acquisition import radar_keys
from radcal.newcase.file_facts import RasterFacts, check_overlap, landcover_codes, product_acquisition, raster_facts
from radcal.newcase.new_materials import MaterialLines, Raw, fixed_laws, material_lines, scalar
from radcal.newcase.new_mistakes import Answers, mistakes_of
from radcal.reading.safe import is_safe_name
from radcal.scene.crs import named_datum
from radcal.scene.names import read_names
from radcal.storage.files import atomic
from radcal.words import sentence

__all__ = ["NewCase", "case_path"]

_DEPRESSION_DEG, _SAMPLING = 45.0, 1.4  # of the default pass: depression, and resolution over pixel spacing
_SYNTHETIC, _NONE = "synthetic", "none"  # words in place of the path of a measured image
_HIDDEN = (
    " # hidden laws, which the calibration is to find: drawn by the seed of the default case, another one for each "
    "material, about the level of its start"
)
_NOT_WRITTEN = ("measurement.path", "scene.materials", "materials.calibrated", "materials.fixed")  # by their name
_FILES = ("scene.elevation", "scene.materials", "scene.labels", "measurement.path")


def case_path(case: str) -> Path:
    """Path of a new case file: a path that ends in .yaml as typed, else ``<case>.yaml``, in ``config`` if it exists."""
    path = Path(case)
    if path.suffix.lower() in (".yaml", ".yml"):
        return path
    folder = Path("config") if len(path.parts) == 1 and Path("config").is_dir() else path.parent
    return folder / f"{path.name}.yaml"


class NewCase(Answers):
    """New case file, with its content and its path.

    Parameters
    ----------
    path : path
        Case file to be written.
    answers : mapping
        Values by key, such as ``radar.looks``; ``measurement.path`` may be ``synthetic`` or ``none``.
    keys : mapping
        For each configuration key, whether it is optional; the order of the keys is that of the lines in section
        ``radar``.

    Attributes
    ----------
    undecided : list of str
        Keys without a value, whose lines are marked.

    Raises
    ------
    ConfigError
        The case file exists, its name is no valid case name, an input file cannot be read, or a value is wrong. The
        message has one line for each mistake.
    """

    def __init__(self, path: Path, answers: Mapping[str, Any], keys: Mapping[str, bool]) -> None:
        self.path, self.name, self._keys = path, path.stem, keys
        super().__init__({"scene.source": "raster", **answers})
        if path.exists():
            self._mistakes.append(f"{path}: exists, and radcal new overwrites nothing: type another name.")
        self._tried("case", check_case_name, self.name, str(path))
        self._notes: dict[str, str] = {}
        self._examples = dict(EXAMPLES)
        self._names: dict[int, str] = {}
        self._counts: dict[int, int] = {}
        self.undecided: list[str] = []
        self._read_scene()
        self._read_image()
        self._derive()
        self._materials = self._material_lines()
        sections = ("scene", "radar") if self.forward else ("scene", "measurement", "radar")
        self._sections = {name: getattr(self, f"_{name}_keys")() for name in sections}
        for section, keys in self._sections.items():
            self.undecided += [f"{section}.{key}" for key in keys if f"{section}.{key}" not in self._values]
        self._refuse_unused([key for key in answers if key not in _NOT_WRITTEN], self._sections)
        wrong = mistakes_of("\n".join(self._lines({})), answers.keys())
        if told := list(dict.fromkeys([*self._mistakes, *wrong])):
            raise ConfigError("\nradcal: ".join(told))

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

    def _facts(self, key: str, numbers: bool = False) -> RasterFacts | None:
        if key not in self._values:
            return None
        facts = self._tried(key, raster_facts, Path(self._values[key]).expanduser(), key, numbers)
        if facts is not None:
            self._notes[key] = facts.sentence()
        return facts

    def _read_scene(self) -> None:
        heights, cover = self._facts("scene.elevation"), self._facts("scene.materials")
        if cover is not None and cover.crs is None and heights is not None:
            self._mistakes.append(
                f"scene.materials: {self._values['scene.materials']} has no CRS and scene.elevation is given, "
                "expected land cover on the map."
            )
            return
        if cover is not None and cover.crs is None:
            self._values["scene.source"] = "slant_range"
            self._values["scene.labels"] = self._values["scene.materials"]
            self._notes["scene.labels"] = self._notes["scene.materials"]
        if heights is not None and heights.crs is not None and cover is not None:
            self._tried("", check_overlap, self._values["scene.elevation"], self._values["scene.materials"])
        if datum := self._values.get("scene.vertical_datum"):
            self._tried("scene.vertical_datum", named_datum, datum)
        if heights is not None and heights.datum is not None:
            self._notes["scene.elevation"] += f", heights above {heights.datum}"
            self._values.setdefault("scene.vertical_datum", "")  # known from the file: no line is needed
        elif self.forward:  # what the heights refer to matters only to a measured image
            self._values["scene.vertical_datum"] = "local"
        if cover is not None:
            path = Path(self._values["scene.materials"]).expanduser()
            heights_of = self._values.get("scene.elevation")
            self._counts = self._tried("scene.materials", landcover_codes, path, heights_of) or {}
            if names := self._values.get("scene.names"):
                self._names = self._tried("scene.names", read_names, Path(names).expanduser(), self._counts, path) or {}
            else:
                self._names = {code: f"code_{code}" for code in self._counts}
                self._read_preset()

    def _read_preset(self) -> None:
        """Take the names of codes from the given land-cover map, or note the maps that contain all codes."""
        preset = self._values.get("scene.landcover")
        if preset is None:
            if not self._slant and (said := landcover_remark(self._counts)):
                self._notes["scene.names"] = said
            return
        if preset not in LANDCOVERS:
            self._mistakes.append(f"--landcover-preset is {preset}, expected one of {', '.join(LANDCOVERS)}.")
            del self._values["scene.landcover"]
            return
        if unknown := [str(code) for code in self._counts if code not in LANDCOVERS[preset]]:
            self._mistakes.append(
                f"--landcover-preset is {preset}, which has no code {', '.join(unknown)}: give --names."
            )
            return
        self._names = {code: LANDCOVERS[preset][code].name for code in self._counts}
        self._values["scene.names"] = ""  # known from the preset: no line is needed

    def _read_product(self) -> None:
        """Fill section ``radar`` from the annotation of a SAFE folder, computed for the scene's heights."""
        self._values |= {"measurement.band": "", "measurement.scale": "", "measurement.radiometry": ""}
        if "scene.elevation" not in self._values:
            return
        path = Path(self._values["measurement.path"]).expanduser()
        heights = Path(self._values["scene.elevation"]).expanduser()
        if not path.exists():
            raise ConfigError(f"measurement.path: the folder {path} does not exist.")
        found = product_acquisition(path, heights, self._values.get("radar.polarisation"))
        self._notes["measurement.path"] = f"{found.sensor}, {found.pass_direction}, {found.start}"
        given = {key for key in self._values if key.startswith("radar.")}
        for key, (value, remark) in radar_keys(found).items():
            if f"radar.{key}" in given or (key == "incidence_deg" and "radar.depression_deg" in given):
                continue
            self._values[f"radar.{key}"] = Raw(str(value)) if isinstance(value, list) else value
            self._notes[f"radar.{key}"] = "; ".join(text for text in ("of the product", remark) if text)

    def _read_image(self) -> None:
        if self._synthetic or self.forward:
            self._values["measurement.source"] = self._values["measurement.path"]
            heights = self._facts("scene.elevation")
            sensor = SENSORS.get(self._values.get("radar.sensor", ""))
            known = {} if sensor is None else sensor.values
            if heights is not None and heights.pixel_m is not None and "range_spacing_m" not in known:
                self._note_spacing(heights.pixel_m, self._values.get("radar.depression_deg", _DEPRESSION_DEG), "cells")
            for way in ("range", "azimuth"):
                if (spacing := self._values.get(f"radar.{way}_spacing_m")) is not None:
                    self._values.setdefault(f"radar.{way}_resolution_m", float(f"{_SAMPLING * spacing:.4g}"))
            return
        self._values["measurement.source"] = "file"
        if is_safe_name(self._values.get("measurement.path", "")):
            self._tried("measurement.path", self._read_product)
            return
        facts = self._facts("measurement.path", numbers=True)
        if facts is None:
            self._values.setdefault("measurement.band", "")
            return
        band = self._values.get("measurement.band")
        if len(facts.bands) == 1:
            band = self._values.setdefault("measurement.band", "") or 1  # the only band: no line is needed
        elif band is None and (wanted := self._values.get("radar.polarisation")) in facts.bands:
            band = self._values["measurement.band"] = facts.bands.index(wanted) + 1
        listed = ", ".join(f"{k} {name or 'without a name'}" for k, name in enumerate(facts.bands, start=1))
        self._notes["measurement.band"] = f"bands of the file: {listed}"
        if (scale := facts.scale(band)) is not None:
            self._values.setdefault("measurement.scale", scale)
        if band is None:
            if (polarised := facts.polarised) is not None:  # examples that fit together and to the file
                self._examples |= {"measurement.band": f"{polarised}", "radar.polarisation": facts.bands[polarised - 1]}
            return
        if not 1 <= band <= len(facts.bands):
            path = self._values["measurement.path"]
            self._mistakes.append(f"measurement.band is {band}, {path} has {len(facts.bands)}.")
            return
        if facts.bands[band - 1] in ("HH", "HV", "VH", "VV"):
            self._values.setdefault("radar.polarisation", facts.bands[band - 1])
        numbers = facts.numbers.get(band)
        if isinstance(numbers, tuple):
            low, middle, high = numbers
            self._notes["measurement.scale"] = f"the numbers run from {low:.3g} to {high:.3g}, median {middle:.3g}"
            self._notes["measurement.scale"] += ": negative ones are in dB" * (low < 0)
        depression = self._values.get("radar.depression_deg")
        if (incidence := self._values.get("radar.incidence_deg")) is not None:
            depression = 90.0 - incidence  # used here as the angle between slant range and level ground
        if facts.pixel_m is not None:
            self._note_spacing(facts.pixel_m, depression, "the image's pixels")

    def _note_spacing(self, pixel_m: tuple[float, float], depression_deg: float | None, of: str) -> None:
        """Set the pixel spacings with which simulated pixels are as large as the pixels of a raster on the map."""
        east, north = pixel_m
        incidence_deg = 90.0 - (_DEPRESSION_DEG if depression_deg is None else depression_deg)
        sensor = SENSORS.get(self._values.get("radar.sensor", ""))
        known = {} if sensor is None else sensor.values_at(incidence_deg)
        # an image whose pixels are too large for the sensor's resolution was resampled: the sensor's spacing stays
        pixels = {"range": east * math.sin(math.radians(incidence_deg)), "azimuth": north}
        if any(
            f"{way}_spacing_m" in known and size * WIDTH_FACTOR > known.get(f"{way}_resolution_m", math.inf)
            for way, size in pixels.items()
        ):
            return
        if "radar.azimuth_spacing_m" not in self._values:
            self._values["radar.azimuth_spacing_m"] = float(f"{north:.4g}")
            self._notes["radar.azimuth_spacing_m"] = f"as {of}"
        if "radar.range_spacing_m" in self._values:
            return
        angle = "sine of the incidence" if "radar.incidence_deg" in self._values else "cosine of the depression angle"
        said = f"{of} of {east:.4g} m times the {angle}"
        self._notes["radar.range_spacing_m"] = said
        if depression_deg is not None:
            spacing = east * math.cos(math.radians(depression_deg))
            self._values["radar.range_spacing_m"] = float(f"{spacing:.4g}")

    def _derive(self) -> None:
        frequency = self._values.get("radar.frequency_ghz")
        if frequency is not None and (letter := letter_band(frequency * 1e9)) is not None:
            self._values.setdefault("radar.band", letter)
        if "radar.looks" in self._values and float(self._values["radar.looks"]).is_integer():
            self._values["radar.looks"] = int(self._values["radar.looks"])

    def _scene_keys(self) -> list[str]:
        if self._slant:
            return ["source", "labels", "names", "near_incidence_deg", "far_incidence_deg"]
        preset = ["landcover"] if "scene.landcover" in self._values else []
        return ["source", "elevation", "materials", *preset, "names", "vertical_datum"]

    def _measurement_keys(self) -> list[str]:
        if self._synthetic:
            return ["source", "synthetic"]
        # the name of an array is needed only if the file has several arrays
        optional = ["dataset"] if "measurement.dataset" in self._values else []
        if self._values.get("measurement.radiometry") == "":  # the product defines it
            return ["source", "path"]
        self._values["measurement.radiometry"] = self._values.get("radar.radiometry", FILL_IN)
        self._notes["measurement.radiometry"] = "the same as in section radar"
        return ["source", "path", "band", *optional, "scale", "radiometry"]

    def _radar_keys(self) -> list[str]:
        # a land cover in slant range has no track, and of an invented pass the defaults are as good as any
        track = {"radar.altitude_m", "radar.depression_deg", "radar.look_side", "radar.heading_deg"}
        unseen, invented = track if self._slant else set[str](), self._synthetic or self.forward
        keys, needed = {**self._keys, "radar.band": True}, set[str]()
        if "radar.incidence_deg" in self._values:
            keys["radar.depression_deg"] = True
        if (name := self._values.get("radar.sensor")) is not None:
            if name not in SENSORS:
                self._mistakes.append(f"--sensor is {name}, expected one of {', '.join(SENSORS)}.")
                del self._values["radar.sensor"]
                return self._radar_keys()
            sensor = SENSORS[name]
            # keys that the sensor gives are optional; radiometry is not given by a sensor
            keys |= {f"radar.{key}": True for key in (*sensor.values, "depression_deg", "frequency_ghz")}
            missing = {f"radar.{key}" for key in sensor.missing(self._given_radar())}
            needed = missing | ({"radar.heading_deg"} if sensor.orbit and not self._slant else set())
            keys |= dict.fromkeys(needed, False)
        return [
            key.removeprefix("radar.")
            for key, may_lack in keys.items()
            if key.startswith("radar.")
            and (key in self._values or key in needed or not (may_lack or invented or key in unseen))
        ]

    def decided_by_sensors(self) -> list[str]:
        """Undecided keys that a sensor may give; empty if the case already names a sensor."""
        known = {f"radar.{key}" for sensor in SENSORS.values() for key in sensor.values}
        return [] if "radar.sensor" in self._values else [key for key in self.undecided if key in known]

    def _given_radar(self) -> dict[str, Any]:
        return {key.removeprefix("radar."): x for key, x in self._values.items() if key.startswith("radar.")}

    def _material_lines(self) -> list[str]:
        """Lines of section ``materials``; a synthetic image gets hidden laws of the materials to calibrate."""
        chosen, preset = self._values.get("materials.calibrated", ()), self._values.get("scene.landcover")
        if chosen and self.forward:
            self._mistakes.append("--material names a material to calibrate, and --image none gives no image for that.")
        fixed = self._tried("", fixed_laws, self._values.get("materials.fixed", ()), self._names) or {}
        made = self._tried("", material_lines, self._names, self._counts, chosen, fixed, preset, not self.forward)
        made = made or MaterialLines([], {}, [], [])
        self._findings = made.findings
        self.undecided += made.undecided
        if self._synthetic:
            laws = "".join(f"\n      {scalar(name)}: {x}" for name, x in made.hidden.items()) or " {}"
            self._values["measurement.synthetic"] = Raw(f"{_HIDDEN}\n    parameters:{laws}")
        return made.lines

    def write(self, comments: Mapping[str, str]) -> list[str]:
        """Write the case, and the names of the codes if no file of names was given.

        Parameters
        ----------
        comments : mapping
            Description of each key, by the full name of the key with dots.

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
            partial.write_text("\n".join(self._lines(comments)) + "\n", "utf-8")
        return [*said, *map(sentence, self._findings), f"{self.path}: written."]

    def _lines(self, comments: Mapping[str, str]) -> list[str]:
        lines = [
            "# Written by radcal new. Every other key has a default (config/config.yaml).",
            *(
                [f"# Write a value in place of each {FILL_IN}, as the example in its line; radcal check lists them."]
                * bool(self.undecided)
            ),
            f"case: {self.name}",
        ]
        for section, keys in self._sections.items():
            lines.append(f"{section}:" + " {}  # as in config/config.yaml" * (not keys))
            for key in keys:
                name = f"{section}.{key}"
                value = self._values.get(name, FILL_IN)
                if value == "":
                    continue
                # the remark on a given file describes the file's content instead of the key
                told = name in self._notes and name in (*_FILES, "measurement.band", "measurement.scale")
                example = self._examples.get(name) if value == FILL_IN else None
                such = "" if example is None else f"for example {key}: {example}"
                comment = "" if told else comments.get(name, "")
                if name == "scene.names":  # what follows is about the option, not about the key
                    comment = comment.partition(";")[0]
                about = [text for text in (comment, self._notes.get(name), such) if text]
                lines.append(f"  {key}: {scalar(value)}" + (f"  # {'; '.join(about)}" if about else ""))
        if not (self._synthetic or self.forward):
            lines += [
                f"uncertainty:\n  level_db: {Uncertainty().level_db:g}  # standard error of the image's absolute level "
                "[dB], often most of a band; the default is a third of Sentinel-1's 1 dB"
            ]
        return [*lines, "materials:", *self._materials]
