"""Phase history of CPHD files, of radcal or of any other program, and images focused from it.

References
----------
NGA.STND.0068-1, "Compensated Phase History Data (CPHD) design and implementation description", version 1.1.0 (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.errors import ConfigError
from radcal.signals.focus import backprojected, write_power
from radcal.signals.platform import LIGHT_MPS, Collection
from radcal.storage.files import atomic

_WIDE = 100.0  # times the processed band is the beam of a file, so that it divides nothing out
_EVEN = 1e-9  # relative difference of frequencies between pulses, below which they are the same
_LARGEST = 100_000_000  # pixels of an image
_AT_ONCE = 1_000_000  # pixels that are focused at once

Doubles = NDArray[np.float64]


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
    numbers, kept : ndarray of int, shape (pulses,) and (frequencies,)
        Vectors of the file, and samples of its spectrum, that are used.
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
    kept: NDArray[np.intp]
    scale: Doubles
    sign: int
    delay: Doubles | None

    def __getitem__(self, pulses: slice) -> NDArray[np.complex64]:
        from sarkit import cphd

        numbers, scale = self.numbers[pulses], self.scale[pulses, None]
        with self.path.open("rb") as file, cphd.Reader(file) as reader:
            read = reader.read_signal(self.channel, start_vector=int(numbers[0]), stop_vector=int(numbers[-1]) + 1)[
                numbers - numbers[0]
            ]
        signal = (read["real"].astype(np.float64) + 1j * read["imag"] if read.dtype.names else read) * scale
        signal = signal if self.sign < 0 else signal.conj()
        if self.delay is not None:
            turns = np.multiply.outer(self.delay[pulses], self.kept * self.one.step_hz)
            signal = np.fft.fft(signal, axis=1)[:, self.kept % signal.shape[1]] * np.exp(-2j * np.pi * turns)
            return np.asarray(signal * (self.kept.size / read.shape[1]), np.complex64)
        return np.asarray(signal[:, self.kept], np.complex64)

    def places_m(self, rows_m: Doubles, columns_m: Doubles) -> Doubles:
        """Places of a grid of the image plane in the coordinates of ``one``, shape (rows, columns, 3)."""
        plane = self.plane @ self.axes.T
        return np.asarray(rows_m[:, None, None] * plane[0] + columns_m[:, None] * plane[1])


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
        The file is no CPHD file, or is bistatic, compressed, or has frequencies that differ from pulse to pulse.
    """
    from lxml import etree
    from sarkit import cphd

    try:
        with path.open("rb") as file, cphd.Reader(file) as reader:
            helper = cphd.XmlHelper(reader.metadata.xmltree)
            channels = [one.text for one in reader.metadata.xmltree.findall("{*}Data/{*}Channel/{*}Identifier")]
            asked = channel or helper.load("{*}Channel/{*}RefChId")
            vectors = reader.read_pvps(asked) if asked in channels else None
            if helper.load("{*}Data/{*}SignalCompressionID") is not None:
                raise ConfigError(f"{path}: its signal is compressed, expected arrays of numbers.")
            if vectors is not None:  # the file is not cut off
                reader.read_signal(asked, start_vector=len(vectors) - 1)
    except (OSError, ValueError, KeyError, RuntimeError, etree.LxmlError) as error:
        raise ConfigError(f"{path}: no readable CPHD file ({error}).") from None
    if vectors is None:
        raise ConfigError(f"{path}: has no channel {asked!r}, expected {' or '.join(map(repr, channels))}.")
    if helper.load("{*}CollectionID/{*}CollectType") != "MONOSTATIC":
        raise ConfigError(f"{path}: CollectType is BISTATIC, expected MONOSTATIC.")
    names = vectors.dtype.names
    numbers = np.flatnonzero(vectors["SIGNAL"] == 1) if "SIGNAL" in names else np.arange(len(vectors))
    vectors = vectors[numbers]
    low, high = float(vectors["FX1"].max()), float(vectors["FX2"].min())
    step, start = float(vectors["SCSS"][0]), vectors["SC0"]
    arrival = helper.load("{*}Global/{*}DomainType") == "TOA"
    even = [vectors["SCSS"], vectors["FX1"] + vectors["FX2"] if arrival else start]
    if len(vectors) < 2 or low >= high or any(np.ptp(each) > _EVEN * abs(each[0]) for each in even):
        raise ConfigError(f"{path}: pulses of channel {asked!r} differ in their frequencies, expected the same in all.")
    samples = int(helper.load(f"{{*}}Data/{{*}}Channel[{{*}}Identifier='{asked}']/{{*}}NumSamples"))
    if arrival:  # its spectrum is about the middle of the band
        step, middle = 1.0 / (samples * step), 0.5 * (low + high)
        half = min(int(0.5 * (high - low) / step + 1e-6), (samples - 1) // 2)
        kept = np.arange(-half, half + 1)
        first_hz = middle - half * step
    else:
        frequency = start[0] + np.arange(samples) * step
        kept = np.flatnonzero((frequency > low - 0.5 * step) & (frequency < high + 0.5 * step))
        first_hz = float(frequency[kept[0]])
    scale = vectors["AmpSF"] if "AmpSF" in names else np.ones(len(vectors))
    origin, plane, ends = _image_plane(helper)
    one, axes = _collection(helper, asked, vectors, origin, (first_hz, step, kept.size))
    sign, delay = int(helper.load("{*}Global/{*}SGN")), start if arrival else None
    return Received(path, asked, one, origin, axes, plane, ends, numbers, kept, scale, sign, delay)


def _collection(
    helper: Any, channel: str, vectors: NDArray[Any], origin: Doubles, band: tuple[float, float, int]
) -> tuple[Collection, Doubles]:
    """Collection in coordinates of track and line of sight, from the reference point, and their unit vectors.

    Transmitter and receiver of a monostatic radar are so near to each other that their middle stands for both.
    """
    centre, count = 0.5 * (vectors["TxPos"] + vectors["RcvPos"]), len(vectors)
    along = centre[-1] - centre[0]
    along /= np.linalg.norm(along)
    line = origin - centre[count // 2]
    line -= (line @ along) * along
    line /= np.linalg.norm(line)
    axes = np.stack([along, line, np.cross(along, line)])
    track, reference = ((places - origin) @ axes.T for places in (centre, vectors["SRPPos"]))
    first_hz, step, samples = band
    carrier, slant = first_hz + samples // 2 * step, np.linalg.norm(track, axis=1)
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
    name = helper.load(f"{{*}}Channel/{{*}}Parameters[{{*}}Identifier='{channel}']/{{*}}DwellTimes/{{*}}{kind}Id")
    poly = helper.load(f"{{*}}Dwell/{{*}}{kind}Time[{{*}}Identifier='{name}']/{{*}}{kind}TimePoly")
    return float(np.asarray(poly)[0, 0])


def _image_plane(helper: Any) -> tuple[Doubles, Doubles, Doubles]:
    """Reference point and axes of the image in earth-centred coordinates, and first and last places along these."""
    from sarkit import wgs84

    scene = "{*}SceneCoordinates/{*}"
    origin, llh = (np.asarray(helper.load(f"{scene}IARP/{{*}}{kind}")) for kind in ("ECF", "LLH"))
    plane = [helper.load(f"{scene}ReferenceSurface/{{*}}Planar/{{*}}{axis}") for axis in ("uIAX", "uIAY")]
    if plane[0] is None:  # a surface of constant height: its tangent plane
        turns = [helper.load(f"{scene}ReferenceSurface/{{*}}HAE/{{*}}{axis}LL") for axis in ("uIAX", "uIAY")]
        plane = [wgs84.geodetic_to_cartesian(llh + np.degrees([*turn, 0.0])) - origin for turn in turns]
    axes = np.array([axis / np.linalg.norm(axis) for axis in plane])
    ends = np.array([helper.load(f"{scene}ImageArea/{{*}}{corner}") for corner in ("X1Y1", "X2Y2")])
    return origin, axes, ends


def write_image(path: Path, folder: Path, spacing_m: float | None = None, channel: str | None = None) -> list[Path]:
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

    Returns
    -------
    list of path
        The files.

    Raises
    ------
    ConfigError
        As for :func:`read_cphd`; the image would be too large.
    """
    found = read_cphd(path, channel)
    one = found.one
    fine = WIDTH_FACTOR * min(LIGHT_MPS / (2.0 * one.samples * one.step_hz), 1.0 / one.band)
    step = spacing_m or 0.5 * fine
    size = np.ptp(found.ends_m, axis=0)
    if (pixels := float(np.prod(size / step))) > _LARGEST:
        least = np.sqrt(np.prod(size) / _LARGEST)
        raise ConfigError(f"{path}: {pixels:.3g} pixels of {step:.3g} m, expected a spacing of at least {least:.2g} m.")
    rows, columns = (np.arange(low + 0.5 * step, high, step) for low, high in found.ends_m.T)
    image = np.empty((rows.size, columns.size), np.complex64)
    for some in np.array_split(np.arange(rows.size), max(1, image.size // _AT_ONCE)):
        places = found.places_m(rows[some], columns).reshape(-1, 3)
        image[some] = backprojected(one, found, places)[0].reshape(some.size, -1)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "focused.h5", folder / "focused.png"]
    with atomic(paths[0]) as partial, h5py.File(partial, "w") as file:
        written = file.create_dataset("image", data=image)
        written.attrs["axes"] = "place along axis_x, place along axis_y"
        file.attrs.update({
            "source": path.name, "channel": found.channel, "spacing_m": step, "origin_ecf_m": found.origin_m,
            "axis_x": found.plane[0], "axis_y": found.plane[1], "first_m": [rows[0], columns[0]],
        })  # fmt: skip
    write_power(paths[1], np.abs(image) ** 2)
    return paths
