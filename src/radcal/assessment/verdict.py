"""Verdicts of a calibration: one sentence on each material, and a first line on all materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radcal.assessment.causes import UNKNOWN
from radcal.assessment.fit_test import DOUBTFUL_SPREAD_DB, SPREAD, FitTest
from radcal.assessment.known import Level, degrees, level_found, level_words

__all__ = ["DOUBT", "OFF_DB", "Known", "all_fit", "first_line", "verdict"]

_COUNTS = ((True, "fits", "fit"), (False, "does not fit", "do not fit"), (None, "cannot be tested", "cannot be tested"))
_NAMED = 4  # largest number of materials that the first line names
_SMALL_DB = 0.1  # smallest half-width of a band [dB] that is given with one decimal
_KNOWN = ": sigma0 known to +-"
_WITHHELD = ", but sigma0 is called known at no angle: "
DOUBT = "the registration is in doubt"
_LOOKS = {"upper": "more", "lower": "fewer"}
OFF_DB = 0.5  # least difference of the means [dB] that a verdict names


@dataclass(frozen=True)
class Known:
    """Interval of local incidence in which sigma0 is known.

    Attributes
    ----------
    between_deg : (float, float) or None
        Ends of the interval in which sigma0 is known [deg]; None if it is known at no angle.
    half_width_db : float or None
        Largest half-width of the 90 % band of sigma0 in the interval [dB]; None if it is known at no angle.
    linear : bool
        Whether the band is that of the linear covariance, because the sampler has not converged.
    levels : tuple of Level
        Sigma0 at the incidence of each pass, for a material that is seen at one incidence; otherwise empty.
    level_error_db : float
        Half-width of a 90 % band that contains only the error of the measured image's level [dB].
    level_key : str
        Configuration key, or cause, of the error of the level.
    withheld : str
        Clause on an error outside of the budget, for which sigma0 is not called known whatever its band; or empty.
    """

    between_deg: tuple[float, ...] | None
    half_width_db: float | None
    linear: bool = False
    levels: tuple[Level, ...] = ()
    level_error_db: float = 0.0
    level_key: str = "uncertainty.level_db"
    withheld: str = ""

    @property
    def remarks(self) -> list[str]:
        """Remarks on the linear covariance, and on the error of level if it is the larger part of the band."""
        said = ["linear covariance: the sampler has not converged"] * self.linear
        widths = [self.half_width_db, *(0.5 * (level.p95_db - level.p05_db) for level in self.levels)]
        width = max((one for one in widths if one is not None), default=0.0)
        # the errors are independent, so that their squares add; narrow bounds or priors can leave less than the level's
        if 0.5 * width**2 < self.level_error_db**2 < width**2:
            said.append(f"+-{self.level_error_db:.1f} dB of it by {self.level_key} alone")
        return said


def verdict(
    name: str,
    test: FitTest,
    cause: str = "",
    known: Known | None = None,
    *,
    level_only: bool = False,
    between_db: float = float("nan"),
    passes: int = 1,
    doubt: str = "",
) -> str:
    """Verdict on one material: a sentence on the fit of its law, and on where sigma0 is known.

    Parameters
    ----------
    name : str
        Name of the material.
    test : FitTest
        Result of the test of the fit of the material's law.
    cause : str
        Likely cause of a misfit of the law.
    known : Known, optional
        Interval in which sigma0 is known; None without a posterior, or for a law without a curve.
    level_only : bool
        Whether the material is seen at one incidence.
    between_db : float
        Standard deviation between fields [dB].
    passes : int
        Number of passes; ``test.mean_db``, ``test.sd_db`` and ``test.measured_sd_db`` are those of the first pass.
    doubt : str
        Clause on a registration in doubt.
    """
    first = " in pass 1" * (passes > 1)
    wide = f"; fields differ by {between_db:.1f} dB (sd), which can hide a misfit" * (between_db > DOUBTFUL_SPREAD_DB)
    wide += f"; {doubt}" * bool(doubt)
    if level_only:
        at = f"level only, seen at one incidence{' in each pass' * (passes > 1)}"
        off = f"its simulated mean {_off(test.mean_db)} the measured{first}"
        if test.fits is False:
            found = level_found(known.levels) if known is not None else ""
            return _ended(f"{name}: {at}, and does not fit: {off}; {cause or UNKNOWN}{found and f'; {found}'}")
        said = [off] * (abs(test.mean_db) > OFF_DB) + [_spread(test, first)] * bool(_spread(test, first))
        said += [known.withheld] if known is not None and known.withheld else []
        level = (
            f": {', '.join([level_words(known.levels), *known.remarks])}" if known is not None and known.levels else ""
        )
        return f"{name}: {at}{level}{''.join(f'; {one}' for one in said)}{wide}."
    if test.fits is None:
        return f"{name}: {_untested(test, passes)}{_known(known) * (not test.unmatched)}{wide}."
    if test.fits:
        return f"{name} fits (residuals {test.residual_sum:.0f} of {test.expected:.0f}){_known(known)}{wide}."
    return _ended(f"{name}: does not fit: {_misfit(test, first)}; {cause or UNKNOWN}{f'; {doubt}' * bool(doubt)}")


def _ended(text: str) -> str:
    """Sentence of a text, which has its own mark if it ends with a question."""
    return text if text.endswith("?") else f"{text}."


def _untested(test: FitTest, passes: int) -> str:
    """Part of a verdict that says why the law is not tested, and how far the density is from the measured one."""
    if not np.isfinite(test.distance):
        return "the law cannot be tested"
    if not test.of_density:
        return "the bins have no more values than the law has parameters, so that the law cannot be tested"
    alone = "one density leaves no degree of freedom to test the law"
    said = alone if passes == 1 else "the law is not tested, because only densities were compared"
    unmatched = ", so that the density is not matched and sigma0 is called known at no angle" * test.unmatched
    times = "less than 0.1" if test.distance < 0.1 else f"{test.distance:.1f}"
    return f"{said}, and its rms is {times} times the sampling error{unmatched}"


def _known(known: Known | None) -> str:
    """Part of a verdict that says at which incidence sigma0 is known, and how well."""
    if known is None:
        return ""
    if known.withheld:
        return f"{_WITHHELD}{known.withheld}"
    remark = f" ({'; '.join(known.remarks)})" * bool(known.remarks)
    if known.between_deg is None or known.half_width_db is None:
        return f", but sigma0 is known well enough at no angle{remark}"
    where = degrees(*known.between_deg)
    width = f"{known.half_width_db:.1f}" if known.half_width_db >= _SMALL_DB else f"{known.half_width_db:.1g}"
    return f"{_KNOWN}{width} dB {where}{remark}; outside that it is not called known"


def _misfit(test: FitTest, first: str) -> str:
    """Part of a verdict on the main misfit: mean and standard deviation of all pixels, a bin, or the looks."""
    residuals, spread = f"residuals {test.residual_sum:.0f} of {test.expected:.0f}", _spread(test, first)
    if abs(test.mean_db) > OFF_DB:
        also = f", and {_spread(test, '')}" if spread else ""
        return f"{residuals}, the simulated mean {_off(test.mean_db)} the measured{first}{also}"
    if spread:
        return spread
    there = f"{residuals}, at {test.worst_deg:.0f} degrees the simulated"
    if abs(test.worst_mean_db) > OFF_DB:
        return f"{there} mean {_off(test.worst_mean_db)} the measured"
    if test.looks_limit and abs(np.log(test.worst_spread)) <= np.log1p(SPREAD):
        return f"{residuals}, and the pixels ask for {_LOOKS[test.looks_limit]} looks than the search allows"
    return f"{there} spread is {test.worst_spread:.2f} times the measured"


def _spread(test: FitTest, first: str) -> str:
    """Part of a verdict on the standard deviation of all pixels; empty if it differs by 15 % or less."""
    ratio = test.sd_db / max(test.measured_sd_db, 1e-12)
    off = max(ratio, 1.0 / max(ratio, 1e-12)) > 1.0 + SPREAD
    return f"the simulated spread{first} is {test.sd_db:.1f} dB, the measured {test.measured_sd_db:.1f}" if off else ""


def _off(difference_db: float) -> str:
    return f"is {abs(difference_db):.1f} dB {'above' if difference_db > 0 else 'below'}"


def all_fit(fits: Sequence[bool | None]) -> bool | None:
    """Whether all laws fit: False if any law does not fit, else None if any law could not be tested."""
    return False if False in fits else None if None in fits or not fits else True


def first_line(verdicts: Mapping[str, str], fits: Mapping[str, bool | None], converged: bool) -> str:
    """First line of terminal output, summary and report: a verdict on all materials.

    Parameters
    ----------
    verdicts : mapping
        Verdict on each material, as a sentence.
    fits : mapping
        Whether the law of each material fits.
    converged : bool
        Whether the search has met its stop criterion.
    """
    going = "" if converged else " The search has not met its stop criterion."
    if len(verdicts) == 1:
        return next(iter(verdicts.values())) + going
    said = []
    level = [
        name for name, text in verdicts.items() if text.startswith(f"{name}: level only") and fits[name] is not False
    ]
    for value, one, many in _COUNTS:
        names = [name for name, fit in fits.items() if fit is value and name not in level]
        who = f" ({', '.join(names)})" if value is not True and len(names) <= _NAMED else ""
        said += [f"{len(names)} {one if len(names) == 1 else many}{who}"] if names else []
    if level:
        who = f" ({', '.join(level)})" if len(level) <= _NAMED else ""
        said.append(f"{len(level)} level only{who}")
    known = [name for name, text in verdicts.items() if _KNOWN in text]
    who = f" ({', '.join(known)})" if 0 < len(known) <= _NAMED and len(known) < len(fits) else ""
    where = f"; sigma0 is known at some angles for {len(known) or 'none'}{who}"
    for why in dict.fromkeys(text.partition(_WITHHELD)[2].partition(";")[0].rstrip(".") for text in verdicts.values()):
        where += f"; {why}" * bool(why)
    doubts = sum(DOUBT in text for text in verdicts.values())
    doubt = f"; {DOUBT} for {doubts}" * bool(doubts)
    return f"Of {len(fits)} materials {', '.join(said)}{where}{doubt}.{going}"
