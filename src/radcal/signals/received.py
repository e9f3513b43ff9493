"""Phase history of CPHD files, of radcal or of any other program, and images focused from it.

References
----------
NGA.STND.0068-1, "Compensated Phase History Data (CPHD) design and implementation description", version 1.1.0 (2021).
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.errors import ConfigError
from radcal.signals.focus import backprojected, write_power
from radcal.signals.platform import LIGHT_MPS, Collection, Doubles
from radcal.storage.records import plain_hdf5

_HEADER = 1 << 16  # bytes within which the header of a file ends
_XML = 1 << 26  # bytes of a file's metadata
_VECTOR = ("TxTime", "TxPos", "RcvPos", "SRPPos", "FX1", "FX2", "SC0", "SCSS")  # parameters that are used
_WIDE = 100.0  # times the processed band is the beam of a file, so that it divides nothing out
_EVEN = 1e-9  # relative difference of bands in the domain of time between pulses, below which they are the same
_LARGEST = 100_000_000  # pixels of an image
_AT_ONCE = 1_000_000  # pixels that are focused at once


@dataclass(frozen=True)
class Received:
    """Phase history of a channel; its pulses are read when a slice of them is asked for.

    Coordinates of ``one`` are those along the track, towards the scene and across both, from the scene's reference
    point. The beam is not known and not divided out.

    Attributes
    ----------
    path, channel : path, str
        File and identifier of the channel.
    one : Collection
        Collection.
    origin_m, axes : ndarray, shape (3,) and (3, 3)
        Reference point and unit vectors of the coordinates in earth-centred coordinates [m].
    plane, ends_m : ndarray, shape (2, 3) and (2, 2)
        Unit vectors of the image plane, and its first and last places along them [m].
    numbers, first : ndarray of int, shape (pulses,)
        Vectors of the file that are used, and the first sample of each one's spectrum that is used.
    frequency_hz : ndarray, shape (2, pulses)
        Middle frequency and frequency step of each pulse [Hz].
    scale : ndarray, shape (pulses,)
        Factor of the numbers of each vector.
    sign : int
        Sign of the phase of a scatterer that is farther away than the reference point.
    delay : ndarray, shape (pulses,), or None
        Time of the first sample where the file is in the domain of time of arrival [s]; None for that of frequency.
    """

    path: Path
    channel: str
    one: Collection
    origin_m: Doubles
    axes: Doubles
    plane: Doubles
    ends_m: Doubles
    numbers: NDArray[np.intp]
    first: NDArray[np.intp]
    frequency_hz: Doubles
    scale: Doubles
    sign: int
    delay: Doubles | None

    def __getitem__(self, pulses: slice) -> NDArray[np.complex64]:
        from sarkit import cphd

        numbers, scale = self.numbers[pulses], self.scale[pulses, None]
        runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)  # vectors between them need no memory
        with self.path.open("rb") as file, cphd.Reader(file) as reader:
            ends = [{"start_vector": int(run[0]), "stop_vector": int(run[-1]) + 1} for run in runs]
            read = np.concatenate([reader.read_signal(self.channel, **run) for run in ends])
        values = (read["real"].astype(np.float64) + 1j * read["imag"] if read.dtype.names else read) * scale
        values = values if self.sign < 0 else values.conj()
        kept = self.first[pulses, None] + np.arange(self.one.samples)
        if self.delay is not None:
            turns = self.delay[pulses, None] * np.fft.fftfreq(read.shape[1], 1.0 / (read.shape[1] * self.one.step_hz))
            values = np.fft.fft(values, axis=1) * np.exp(-2j * np.pi * turns) * (self.one.samples / read.shape[1])
            values = np.fft.fftshift(values, axes=1)
        signal = np.take_along_axis(values, kept, axis=1)
        if (wrong := numbers[~np.isfinite(signal).all(axis=1)]).size:
            raise ConfigError(
                f"{self.path}: vector {wrong[0]} of channel {self.channel!r} has samples that are no number."
            )
        return np.asarray(signal, np.complex64)


def read_cphd(path: Path, channel: str | None = None) -> Received:
    """Phase history of a monostatic CPHD file.

    Parameters
    ----------
    path : path
        CPHD file.
    channel : str, optional
        Identifier of the channel; by default the reference channel.

    Raises
    ------
    ConfigError
        The file is no CPHD file, lacks what is needed, is bistatic or compressed, or its pulses have no common band.
    """
    from lxml import etree

    try:
        return _read(path, channel)
    except (
        OSError, ValueError, LookupError, SyntaxError, RuntimeError, MemoryError, etree.LxmlError,
    ) as error:  # fmt: skip
        raise ConfigError(f"{path}: no readable CPHD file ({error}).") from None


def _metadata(path: Path, channel: str | None) -> tuple[Any, str, NDArray[Any]]:
    """Metadata, identifier of the channel, and the parameters of its vectors."""
    from sarkit import cphd

    if path.exists() and not path.is_file():
        raise ValueError("it is a folder or a device")
    with path.open("rb") as file:
        head = file.read(_HEADER)
        if not head.startswith(b"CPHD/1.") or b"\f\n" not in head:
            raise ValueError("it does not begin with a header of CPHD 1.x")
        _, sizes = cphd.read_file_header(io.BytesIO(head))
        if int(sizes["XML_BLOCK_SIZE"]) > _XML:
            raise ValueError(f"XML_BLOCK_SIZE is {sizes['XML_BLOCK_SIZE']}, expected at most {_XML}")
        file.seek(0)
        with _complete(), cphd.Reader(file) as reader:
            helper = cphd.XmlHelper(reader.metadata.xmltree)
            channels = [one.text for one in reader.metadata.xmltree.findall("{*}Data/{*}Channel/{*}Identifier")]
            asked = channel or _of(helper, "{*}Channel/{*}RefChId")
            if asked not in channels:
                expected = " or ".join(map(repr, channels))
                raise ConfigError(f"{path}: has no channel {asked!r}, expected {expected}.")
            if helper.load("{*}Data/{*}SignalCompressionID") is not None:
                raise ConfigError(f"{path}: its signal is compressed, expected arrays of numbers.")
            vectors = reader.read_pvps(asked)
            reader.read_signal(asked, start_vector=len(vectors) - 1)  # the file is not cut off
    if (kind := _of(helper, "{*}CollectionID/{*}CollectType")) != "MONOSTATIC":
        raise ConfigError(f"{path}: CollectType is {kind}, expected MONOSTATIC.")
    return helper, asked, vectors


@contextlib.contextmanager
def _complete() -> Iterator[None]:
    """Context of calls of sarkit, which fail by a TypeError or an AttributeError if an element is missing or empty."""
    try:
        yield
    except (TypeError, AttributeError):
        raise ValueError("an element of its metadata is missing or empty") from None


def _of(helper: Any, where: str, optional: bool = False) -> Any:
    """Value of an element of the metadata; None for a missing one that is optional."""
    with _complete():
        value = helper.load(where)
    if value is None and not optional:
        raise ValueError(f"{where.replace('{*}', '')} is missing")
    if isinstance(value, float | np.ndarray) and not np.isfinite(value).all():
        raise ValueError(f"{where.replace('{*}', '')} is {value}, expected finite numbers")
    return value


def _read(path: Path, channel: str | None) -> Received:
    helper, asked, vectors = _metadata(path, channel)
    names = vectors.dtype.names or ()
    numbers = np.flatnonzero(vectors["SIGNAL"] == 1) if "SIGNAL" in names else np.arange(len(vectors))
    if len(vectors := vectors[numbers]) < 2:
        raise ConfigError(f"{path}: channel {asked!r} has {len(vectors)} pulses with a signal, expected 2 or more.")
    scale = vectors["AmpSF"] if "AmpSF" in names else np.ones(len(vectors))
    for name, values in [("AmpSF", scale), *((name, vectors[name]) for name in _VECTOR)]:
        if not np.isfinite(values).all():
            raise ValueError(f"{name} is no number in some vectors")
    if scale.min() <= 0.0:
        raise ConfigError(f"{path}: AmpSF of channel {asked!r} is {scale.min():g} in a vector, expected more than 0.")
    low, high = float(vectors["FX1"].max()), float(vectors["FX2"].min())
    steps, start = vectors["SCSS"], vectors["SC0"]
    if (domain := _of(helper, "{*}Global/{*}DomainType")) not in ("FX", "TOA"):
        raise ConfigError(f"{path}: DomainType is {domain}, expected FX or TOA.")
    arrival = domain == "TOA"
    if low >= high or steps.min() <= 0.0:
        raise ConfigError(f"{path}: pulses of channel {asked!r} have no common band, expected FX1 below FX2 in all.")
    samples = int(_of(helper, f"{{*}}Data/{{*}}Channel[{{*}}Identifier='{asked}']/{{*}}NumSamples"))
    if arrival:  # its spectrum is about the middle of the band
        if any(np.ptp(each) > _EVEN * abs(each[0]) for each in (steps, vectors["FX1"] + vectors["FX2"])):
            raise ConfigError(f"{path}: pulses of channel {asked!r} differ in their bands, expected the same in all.")
        steps = 1.0 / (samples * steps)
        start = 0.5 * (low + high) - samples // 2 * steps
    first = np.maximum(np.floor((low - start) / steps - 0.5).astype(int) + 1, 0)
    last = np.minimum(np.ceil((high - start) / steps + 0.5).astype(int) - 1, samples - 1)
    if (count := int((last - first).min()) + 1) < 2:
        raise ConfigError(
            f"{path}: spectra of channel {asked!r} begin at {start[0]:g} Hz, expected samples between FX1 and FX2, "
            f"{low:g} to {high:g}."
        )
    middle = start + (first + count // 2) * steps
    origin, plane, ends = _image_plane(helper)
    one, axes = _collection(helper, asked, vectors, origin, (middle[0], steps[0], count))
    if (sign := int(_of(helper, "{*}Global/{*}SGN"))) not in (-1, 1):
        raise ConfigError(f"{path}: SGN is {sign}, expected -1 or 1.")
    if (np.diff(one.track_m[:, 0]) <= 0.0).any():
        raise ConfigError(
            f"{path}: TxPos and RcvPos of channel {asked!r} go back along the track, expected an advance."
        )
    frequency, delay = np.stack([middle, steps]), vectors["SC0"] if arrival else None
    return Received(path, asked, one, origin, axes, plane, ends, numbers, first, frequency, scale, sign, delay)


def _collection(
    helper: Any, channel: str, vectors: NDArray[Any], origin: Doubles, band: tuple[float, float, int]
) -> tuple[Collection, Doubles]:
    """Collection in coordinates of track and line of sight, from the reference point, and their unit vectors.

    Transmitter and receiver of a monostatic radar are so near to each other that their middle stands for both.
    """
    centre, count = 0.5 * (vectors["TxPos"] + vectors["RcvPos"]), len(vectors)
    along = centre[-1] - centre[0]
    along /= np.linalg.norm(along) or 1.0
    line = origin - centre[count // 2]
    line -= (line @ along) * along
    line /= np.linalg.norm(line) or 1.0
    axes = np.stack([along, line, np.cross(along, line)])
    track, reference = ((places - origin) @ axes.T for places in (centre, vectors["SRPPos"]))
    carrier, step, samples = band
    slant = np.linalg.norm(track, axis=1)
    spot = bool(np.ptp(reference, axis=0).max() < 1e-3)
    used = np.ones(count, np.bool_)
    if not spot:  # the pulses that see the reference point
        middle_s, dwell_s = (_at_reference(helper, channel, kind) for kind in ("COD", "Dwell"))
        used = np.abs(vectors["TxTime"] - middle_s) <= 0.5 * dwell_s
    sines = -track[used, 0] / slant[used]
    ends = np.array([sines.min(), sines.max()])
    wide = float(np.ptp(ends)) * used.sum() / max(used.sum() - 1, 1)
    time_s = float(np.ptp(vectors["TxTime"])) or 1.0
    speed = float(np.linalg.norm(centre[-1] - centre[0])) / time_s
    wavelength = LIGHT_MPS / carrier
    one = Collection(
        track, reference, (count - 1) / time_s, speed, carrier, step, samples, wavelength / (_WIDE * wide),
        2.0 * wide / wavelength, 1, float(slant.mean()), 0.0, None, float(ends.mean()), reference[0] if spot else None,
    )  # fmt: skip
    return one, axes


def _at_reference(helper: Any, channel: str, kind: str) -> float:
    """Time of the middle of a channel's aperture (``COD``) or its length (``Dwell``) at the reference point [s]."""
    name = _of(helper, f"{{*}}Channel/{{*}}Parameters[{{*}}Identifier='{channel}']/{{*}}DwellTimes/{{*}}{kind}Id")
    poly = _of(helper, f"{{*}}Dwell/{{*}}{kind}Time[{{*}}Identifier='{name}']/{{*}}{kind}TimePoly")
    return float(np.asarray(poly)[0, 0])


def _image_plane(helper: Any) -> tuple[Doubles, Doubles, Doubles]:
    """Reference point and axes of the image in earth-centred coordinates, and first and last places along these."""
    from sarkit import wgs84

    scene = "{*}SceneCoordinates/{*}"
    origin, llh = (np.asarray(_of(helper, f"{scene}IARP/{{*}}{kind}")) for kind in ("ECF", "LLH"))
    plane = [_of(helper, f"{scene}ReferenceSurface/{{*}}Planar/{{*}}{axis}", True) for axis in ("uIAX", "uIAY")]
    if any(axis is None for axis in plane):  # a surface of constant height: its tangent plane
        turns = [_of(helper, f"{scene}ReferenceSurface/{{*}}HAE/{{*}}{axis}LL") for axis in ("uIAX", "uIAY")]
        plane = [wgs84.geodetic_to_cartesian(llh + np.degrees([*turn, 0.0])) - origin for turn in turns]
    axes = np.array([axis / np.linalg.norm(axis) for axis in plane])
    ends = np.array([_of(helper, f"{scene}ImageArea/{{*}}{corner}") for corner in ("X1Y1", "X2Y2")])
    return origin, axes, ends


def _part(found: Received, size_m: float | None, centre: tuple[float, float] | None) -> Doubles:
    """First and last places along the axes of the image plane of a square in the file's image area, shape (2, 2)."""
    from sarkit import wgs84

    middle = np.zeros(2)
    if centre is not None:
        if size_m is None:
            raise ConfigError(f"{found.path}: --centre is given without --size, expected both.")
        height = wgs84.cartesian_to_geodetic(found.origin_m)[2]
        away = wgs84.geodetic_to_cartesian([*centre, height]) - found.origin_m
        middle = np.linalg.lstsq(found.plane.T, away, rcond=None)[0]
    half = np.inf if size_m is None else 0.5 * size_m
    ends: Doubles = np.clip(middle + np.array([[-half], [half]]), *found.ends_m)
    if not (ends[0] < ends[1]).all():  # also of places that are no number
        x, y = middle
        raise ConfigError(
            f"{found.path}: --centre is {x:.0f} and {y:.0f} m from the reference point, outside of the image area."
        )
    return ends


def write_image(
    path: Path,
    folder: Path,
    spacing_m: float | None = None,
    channel: str | None = None,
    size_m: float | None = None,
    centre: tuple[float, float] | None = None,
) -> list[Path]:
    """Focus a CPHD file by back-projection on the image plane that it names.

    Parameters
    ----------
    path : path
        CPHD file.
    folder : path
        Folder of ``focused.h5``, with the complex image and its place on the earth, and of the picture ``focused.png``.
    spacing_m : float, optional
        Distance between pixels [m]; by default half of the finer resolution.
    channel : str, optional
        Identifier of the channel.
    size_m : float, optional
        Side of a square in the image area [m]; by default the whole area.
    centre : (float, float), optional
        Latitude and longitude of the square's middle [deg]; by default the reference point.

    Returns
    -------
    list of path
        The files.

    Raises
    ------
    ConfigError
        As for :func:`read_cphd`; the image would be too large; the centre lies outside of the image area; a vector has
        samples that are no numbers.
    """
    found = read_cphd(path, channel)
    one = found.one
    step = spacing_m or 0.5 * WIDTH_FACTOR * min(one.gate_m, 1.0 / one.band)
    ends = _part(found, size_m, centre)
    if not ((size := np.ptp(ends, axis=0)) >= step).all():
        raise ConfigError(f"{path}: {size.min():.3g} m have no pixel of {step:.3g} m, expected a smaller spacing.")
    if (pixels := float(np.prod(size / step))) > _LARGEST:
        least = np.sqrt(np.prod(size) / _LARGEST)
        raise ConfigError(
            f"{path}: {pixels:.3g} pixels of {step:.3g} m, expected a spacing of at least {least:.2g} m, or a smaller "
            "size."
        )
    rows, columns = (np.arange(low + 0.5 * step, high, step) for low, high in ends.T)
    down, across = found.plane @ found.axes.T
    image = np.empty((rows.size, columns.size), np.complex64)
    for some in np.array_split(np.arange(rows.size), max(1, image.size // _AT_ONCE)):
        places = (rows[some, None, None] * down + columns[:, None] * across).reshape(-1, 3)
        image[some] = backprojected(one, found, places, found.frequency_hz)[0].reshape(some.size, -1)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "focused.h5", folder / "focused.png"]
    with plain_hdf5(paths[0]) as file:
        written = file.create_dataset("image", data=image)
        written.attrs["axes"] = "place along axis_x, place along axis_y"
        file.attrs.update({
            "source": path.name, "channel": found.channel, "spacing_m": step, "origin_ecf_m": found.origin_m,
            "axis_x": found.plane[0], "axis_y": found.plane[1], "first_m": [rows[0], columns[0]],
        })  # fmt: skip
    write_power(paths[1], np.abs(image) ** 2)
    return paths
