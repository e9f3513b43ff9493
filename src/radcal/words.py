"""Sentences on findings: the one catalogue for terminal, page and JSON."""

from __future__ import annotations

from radcal.findings import Finding

__all__ = ["text"]

_TEXTS: dict[str, str] = {
    "depression": "{about} is displaced along slant range by {px_per_100_rows:+.1f} pixels per 100 rows (a straight "
    "line explains {share_percent:.0f} % of the variance of the displacement), as with {key} {implied_deg:.1f} in "
    "place of {declared_deg:g}: set {do}, or, if the angle is right, correct radar.range_spacing_m or the cell size of "
    "the scene, which is then off by {off_percent:.1f} %.",
    "geometry_unchecked": "{about} was not registered, so that {key} {declared_deg:g}, the spacing in slant range and "
    "the place of the image were not compared with the image.",
    "relief": "{about} changes by {db_per_deg:+.3f} +- {error_db_per_deg:.3f} dB per degree of local incidence on the "
    "relief, {of_simulated:.2f} +- {of_simulated_error:.2f} times as much as the simulated image: check {do}, whose "
    "heights must be in metres (not feet), of the same place, and not flipped.",
    "place": "{about} does not show the place of the scene: the mean levels of its squares of {square_px:.0f} pixels "
    "have a correlation of {correlation:.2f} with those of the simulated image, and of up to {shifted:.2f} if it is "
    "shifted by two squares or more: check {do}, or set the materials and the elevation of the place that it shows.",
}
"""Template of each code: names are attributes of the finding, or its numbers."""


def text(finding: Finding) -> str:
    """Sentence on a finding, which begins with ``warning:`` if the finding is a warning."""
    said = _TEXTS[finding.code].format(about=finding.about, do=finding.do, **finding.numbers)
    return f"warning: {said}" if finding.severity == "warning" else said
