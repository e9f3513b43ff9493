"""Catalogue: the text of each code of a finding, with places for what it is about, its numbers and what to set."""

from __future__ import annotations

from collections.abc import Mapping

_MAPPED = (
    "each image is mapped to zero median and unit interquartile range; before this, the median of the measured image "
    "is {offset_db:+.2f} dB from that of the reference run, and its interquartile range {scale:.2f} times as large. "
    "With this mapping, wrong laws of other materials shift and stretch the law that is found"
)
_FROM_REFERENCE = (
    "the measured image minus the reference run is {offset_db:+.2f} dB (standard error {error_db:.2f}) on {about}"
)

_LOOKS = (
    "the speckle of {about} is that of {looks:.3g} looks in its most homogeneous areas (95 %: {low:.3g} to {high:.3g}, "
    "{windows:.0f} windows of {side_px:.0f} x {side_px:.0f} independent pixels); radar.looks is {declared:g}"
)
_SPREAD = (
    "the point spread of {about}, estimated from its speckle, is {range_least}{range_m:.3g} m (standard error "
    "{range_error_m:.2g}) in slant range and {azimuth_least}{azimuth_m:.3g} m (standard error {azimuth_error_m:.2g}) "
    "in azimuth; radar.range_resolution_m is {range_declared_m:g} and radar.azimuth_resolution_m {azimuth_declared_m:g}"
)
_CORRELATED = (
    _SPREAD + "; neighbouring pixels are correlated over {correlation_ratio:.2g} times the area of these resolutions"
)
_COUNTS = (
    "{pixels:,} pixels; not used are {no_data:,} without data, {zero:,} of zero power, {negative:,} of negative power "
    "and {impossible:,} beyond +-200 dB"
)
_RELIEF = (
    "{about} changes by {db_per_deg:+.2f} dB (standard error {error_db_per_deg:.2f}) per degree of local incidence on "
    "the relief; ground of constant gamma would get darker by {constant_gamma_db_per_deg:.2f} dB: "
)
_WALLS = "{about}: {walls:.0f} boxes scatter from roof and walls separately, {bounce:.0f} have a double bounce"
_TRANSFORMATION = "{about}: the best transformation from {source} to {target} needs a grid that is not installed; "
_SMOOTHS = "; the surrogate smooths over runs instead of passing through them"
_CRITERION_MET = "{about}: stop criterion met after {counted_runs}: "
_EXHAUSTED = "every combination of the integer parameters inside the bounds has been simulated"
_NARROWS = "{about}: a pass of {name} is expected to narrow "
_TO_DB = (
    "from +-{now_db:.2f} dB to +-{after_db:.2f} dB (mean half-width between {over_from_deg:.1f} and {over_to_deg:.1f} "
    "degrees)"
)
_TO_RATIO = "to {ratio:.2f} times their half-widths (geometric mean over the materials)"

TEXTS: Mapping[str, str] = {
    # scenes
    "cells": "{about}: cells of {cell_m:g} m in {crs}",
    "resampled": "{about} is read as follows: elevation {elevation}, materials {materials}",
    "vertical_datum": "{about}: vertical datum {datum} ({origin})",
    "height_steps": "{about}: heights are in steps of {step_m:.3g} m. Their rounding error of {rounding_m:.2g} m is "
    "part of scene.elevation_error_m, which is now {error_m:.2g} m (a slope error of {slope_error_deg:.2g} deg)",
    "no_elevation": "{about}: {cells:.0f} of {of:.0f} cells have no elevation; theirs is filled in from the cells "
    "around them, and they get no material",
    "no_material": "{about}: {cells:.0f} of {of:.0f} cells have no material",
    "cdb_left_out": "{about} is left out: {reason}",
    "cdb_levels": "{about}: {dataset} is read from the levels of detail {levels}",
    "cdb_posts": "{about}: the elevation has posts {post_m:.3g} m apart, {cells:.2g} times the scene's cell size",
    "cdb_tags": "{about}: the georeference tags of {tiles:.0f} tiles of elevation lie up to {off_m:.0f} m from "
    "the posts of the CDB standard; the tiles are placed by their names, not by the tags",
    "cdb_base_materials": "{about} names base materials that Metadata/Materials.xml does not define: {names}",
    "cdb_unmapped": "{about} maps these composite materials to no material, so that their cells have none: {names}",
    "cdb_no_material": "{about} has no raster of materials in scene.bounds: all cells are of the default {name}",
    "cdb_mixed": "{about}: in {percent:.3g} % of the cells with a material, no single composite material fills a share "
    "of {share:g} or more",
    "features_unmapped": "{about}: {features:.0f} features fit no key of the mapping: {codes}",
    "features_without_size": "{about}: {features:.0f} features have no size, and make no objects: {codes}",
    "features_large": "{about}: {features:.0f} features have a box with a side above 200 m, and make no objects: "
    "{codes}",
    "features_burnt": "{about}: {features:.0f} lines and areas are drawn into the map of materials",
    "features_narrow": "{about}: {features:.0f} lines are narrower than a cell and drawn one cell wide: {codes}",
    "features_without_place": "{about}: {features:.0f} features have no geometry that can be read, and are left out",
    "objects": "{about}: {objects:.0f} objects, {points:.0f} of them points",
    "walls": _WALLS,
    "walls_reflect_all": _WALLS + "; without permittivities, walls reflect all power in it",
    "transformation": _TRANSFORMATION + "the one used is accurate to {accuracy_m:g} m",
    "transformation_unknown": _TRANSFORMATION + "the one used has no known accuracy",
    # measured images
    "pixels": "{about}: " + _COUNTS,
    "pixels_at_ground": "{about}, resampled to the grid of the scene's image: " + _COUNTS,
    "pixels_repeated": "{about} was resampled by nearest neighbour: {range_percent:.2g} % of the adjacent pixels in "
    "slant range and {azimuth_percent:.2g} % in azimuth are equal; the effective sample sizes take this into account "
    "as correlation",
    "looks": _LOOKS,
    "looks_uncertain": _LOOKS + ": too few windows to be certain, check measurement.scale and radar.looks",
    "looks_more": _LOOKS + ": the simulated speckle therefore varies more than the measured",
    "looks_fewer": _LOOKS + ": the simulated speckle therefore varies less than the measured; with objective: "
    "classes and target.looks: free, the search takes the difference for texture",
    "looks_single": "{about}: complex pixels have a single look, radar.looks is {declared:g}",
    "looks_unknown": "the speckle of {about} could not check radar.looks and measurement.scale: the areas of single "
    "materials have too few pixels",
    "resolutions_unknown": "the speckle of {about} could not check radar.range_resolution_m and "
    "radar.azimuth_resolution_m, nor whether the image was filtered: the areas of single materials are too small "
    "(fewer than {pairs:.0f} pairs of pixels {apart_px:.0f} pixels apart in slant range or in azimuth), or their "
    "speckle is correlated over most of the width of an area",
    "resolution_unusual": "{about} of {resolution_m:g} m is {spacings:.3g} times the pixel spacing; in most images it "
    "is at most {most_spacings:.2g} times the spacing. The speckle could not check it",
    "filtered": "{about} is speckle-filtered: " + _CORRELATED + "; its looks are {looks_ratio:.2g} times radar.looks. "
    "Use the image before filtering, unless radar.looks and the resolutions are both wrong",
    "smoothed": "{about} is speckle-filtered or smoothed in another way, unless the resolutions are wrong: "
    + _CORRELATED,
    "resolutions": _SPREAD + ": set them to {range_possible_m:g} and {azimuth_possible_m:g}, the nearest that the "
    "pixel spacings allow, unless the image was resampled before, has texture of a few pixels, or an impulse response "
    "without weighting (estimated 24 to 34 % too fine)",
    "image_plane": "{about}: its rows lie in the image plane {plane}, not in slant range as in the scene's image",
    "polarisation_unknown": "{about}: its polarisation is unknown, it is taken for radar.polarisation",
    "carrier_unknown": "{about}: its carrier frequency is unknown, it is taken for one of radar.band",
    "carrier_not_compared": "{about}: its carrier of {frequency_ghz:.4g} GHz is not compared with radar.band = {band}, "
    "which is none of {bands}",
    "levels_sigma0": "{about}: sigma0 by its {polynomial}, for level ground (radiometry sigma0_ref)",
    "levels_converted": "{about}: it has no SigmaZeroSFPoly: sigma0 is {quantity} by its {polynomial}, times the "
    "cosine of {angle} = {angle_deg:.2f} deg ({factor_db:.2f} dB) in the whole image, which is exact for level "
    "ground at the scene centre point",
    "levels_relative": "{about}: it has none of SigmaZeroSFPoly, BetaZeroSFPoly and GammaZeroSFPoly: levels are "
    "relative: use target.normalisation: offset or image",
    "foreign": "{about}: {text}",  # of a variant of another distribution, whose text is in the numbers
    "noise_subtracted": "{about}: thermal noise was subtracted by the processor, so that radar.nesz_db should be far "
    "below the level of the image",
    "product": "{about}: its name says {product}: it is read with scale {scale}, radiometry {radiometry}, "
    "polarisation {polarisation}",
    "product_filtered": "{about}: its name says that the speckle was filtered; use the product before filtering",
    "acquisition": "{about}: {sensor} {polarisation} of {start}, {pass_direction}, heading {heading_deg:.1f} deg over "
    "the scene, looking {look_side}, incidence {incidence_deg:.2f} deg, {frequency_ghz:.4g} GHz, {range_looks:.0f} x "
    "{azimuth_looks:.0f} looks (equivalent {looks:.3g}), pixels of {range_spacing_m:g} m in ground range and "
    "{azimuth_spacing_m:g} m in azimuth, noise-equivalent sigma0 {nesz} dB",
    "look_direction": "{about}: it looks to {look_deg:.1f} deg from north (heading {heading_deg:.2f} deg), the "
    "configured pass to {configured_deg:.1f} deg, so that slopes have another incidence than in the image",
    "noise_differs": "{about}: its noise-equivalent sigma0 is {nesz_db:.1f} dB at {angle_deg:.1f} deg, radar.nesz_db "
    "{configured_db:.1f} dB",
    "radar_differs": "{about}: its {key} is {own_m:.3g} at the scene, radar.{key} {configured_m:g}",
    "geoid_unknown": "{about}: heights above {datum} are taken as heights above the ellipsoid, since PROJ has no grid "
    "of its geoid: each metre between them displaces the image by {m_per_m:.2f} m along the look, which the "
    "registration must find",
    "incidence_by_map": "{about}: the map places its pixels, so that a wrong {key} does not displace them and can "
    "remain unnoticed. The value {declared_deg:g} gives incidences {between} on level ground: compare them with the "
    "metadata of the image",
    "incidence_of_band": "{about}: {key} of {declared_deg:g} gives incidences {between} on level ground, as band "
    "{band:.0f} ({name}) does (median difference {off_deg:+.1f} degrees)",
    "relief_turned": _RELIEF + "its bright slopes face away from the radar with radar.look_side {look_side} and "
    "radar.heading_deg {heading_deg:g}; set the side and the heading from which the image was taken (or is "
    "scene.elevation upside down?)",
    "relief_not_followed": _RELIEF + "it does not follow the relief of scene.elevation as seen with radar.look_side "
    "{look_side} and radar.heading_deg {heading_deg:g}; is the elevation of this area, and not flipped or displaced?",
    "height_shift": "{about}: the registration moves ground by {m_per_m:+.2f} m (standard error {error_m_per_m:.2f}; "
    "negative: nearer to the radar) in slant range for each metre of its height, expected 0 (an image geocoded on the "
    "ellipsoid has {ellipsoid_m_per_m:+.2f}): if the image lies on the map, is it terrain-corrected? Else, are "
    "radar.depression_deg and the heights in scene.elevation right?",
    # cases, before a run is made
    "scene_large": "The scene is large, so that this check does not read it; the calibration reads it when it starts",
    "starts_as_truth": "{about}: measurement.synthetic.parameters gives no hidden law, so that the starting law makes "
    "the measured image, and the search begins at its solution",
    "bounces_outside": "the double bounce of {walls:.0f} of {of:.0f} objects on {about} uses its law outside of the "
    "{low_deg:.0f} to {high_deg:.0f} degrees of its pixels: the level of these echoes is extrapolated (objects "
    "{objects}, counted from 1)",
    "ground_hidden": "{hidden_percent:.0f} % of the simulated image's pixels are in shadow or layover or without "
    "ground ({without_percent:.0f} % show no ground at all), and half of the ground is steeper than {slope_deg:.0f} "
    "degrees: are the heights in {about} in another unit than metres ({units}), or is radar.depression_deg wrong?",
    "noise_positive": "{about} is {level_db:g} dB: is a minus sign missing (-{level_db:g})? Noise above 0 dB hides "
    "nearly all ground, unless the levels of the image itself lie far above 0 dB",
    "law_bright": "{about}: {law} gives gamma {gamma_db:.3g} dB at an incidence of {incidence_deg:g} degrees, the "
    "brightest terrain of docs/landcover.md has {brightest_db:g} dB: is a minus sign missing?",
    "heading_missing": "{about} is not given, so that the track heads to the grid's north",
    "level_counted": "the level of the image has a standard error of {level_db:g} dB ({about}): a 90 % band of sigma0 "
    "from this pass alone has a half-width of at least {half_width_db:.2g} dB",
    "no_contrast": "the image simulated at the start has no contrast between materials (the level of its squares "
    "varies by {contrast_db:.2f} dB), so that no image can be registered onto it: give {about} starts that differ "
    "(materials.*.start), or, if the measured image lies on the simulated image's pixels already, set "
    "registration.method: none",
    # the simulator, its runs and passes
    "declared_random": "The simulator is declared not to be deterministic" + _SMOOTHS,
    "repeats": "The simulator is deterministic: the reference run repeated gives the same pixels",
    "does_not_repeat": "The simulator is not deterministic: the reference run repeated, with equal parameters and "
    "seed, differs by up to {largest_db:.2g} dB in a pixel" + _SMOOTHS,
    "seedless": "The simulator takes no seed: no run with other random numbers can be made, and rms_fresh is not given",
    "seed_without_effect": "The final run with another seed gives the same pixels as the one that it repeats, bit for "
    "bit: the seed does not reach the program's random numbers, or there are none (simulator.seedless: true says so). "
    "The rms with other random numbers is not given",
    "scatter": "{about}: between runs of equal parameters the pixels' mean scatters by {mean_db:.2g} dB, its standard "
    "deviation by {sd_percent:.2g} %, its skewness by {skewness:.2g} (one standard deviation, from the repeated "
    "reference run); the surrogate assumes at least this noise",
    "passes_together": "The laws are those of {passes:.0f} passes together; densities, images, pixels and checks on "
    "held-out ground are those of pass 1",
    "too_few_pixels": "{about}: this pass has too few pixels of it, and is not used for this material",
    "outside_angles": "{about}: {share_percent:.0f} % of its pixels are seen outside of the {from_angle_deg:g} to "
    "{to_angle_deg:g} deg that law {law!r} was made for; there it is an extrapolation",
    "outside_data": "{about}: law {law!r} is an extrapolation: {doubt}",
    # the end of the search
    "search_goes_on": "{about}: {standing} so far",
    "search_stagnated": "{about}: {standing}, without improvement for {counted_idle}",
    "search_out_of_runs": "{about}: {standing} after {counted_runs}: stop.max_runs allows no further run",
    "search_out_of_time": "{about}: {standing} after {hours:.2g} h of the simulator: stop.max_hours leaves too "
    "little for a further run",
    "rms_before_infill": "{about}: rms {rms:.2g} within the tolerance {tolerance:.2g} before any proposed (infill) run",
    "rms_reached": "{about}: rms {rms:.2g} within the tolerance {tolerance:.2g} after {counted_runs}",
    "rms_unreachable": "{about}: {standing}, after {counted_runs}; the smallest rms inside the bounds that the "
    "surrogate predicts, less two standard errors, is {floor:.2g}: the target seems out of reach there",
    "rms_exhausted": "{about}: {standing}: " + _EXHAUSTED,
    "rms_below_sampling_error": "{about}: rms {rms:.2g}, without improvement for {counted_idle} and below a third of "
    "the sampling error {sampling:.2g}: a better fit would not be significant (stop.at_sampling_error: false goes on)",
    "criterion_met_exhausted": _CRITERION_MET + _EXHAUSTED,
    "no_better_x": _CRITERION_MET + "the surrogate of all runs predicts no clearly better X",
    "no_better_law": _CRITERION_MET + "the surrogate of all runs predicts no clearly better law",
    "law_settled": _CRITERION_MET + "the best law that the surrogate of all runs predicts differs from that of the "
    "best run by {moved_db:.2g} dB over the incidence seen",
    # what the model says
    "depression": "{about} is displaced along slant range by {px_per_100_rows:+.1f} pixels per 100 rows (a straight "
    "line explains {share_percent:.0f} % of the variance of the displacement). This would be so if {key} were "
    "{implied_deg:.1f} and not {declared_deg:g}, or if radar.range_spacing_m or the cell size of the scene were wrong "
    "by {off_percent:.1f} %",
    "geometry_unchecked": "{about} was not registered, so that {key} ({declared_deg:g}), the spacing in slant range "
    "and the place of the image are unchecked",
    "relief": "{about} changes by {db_per_deg:+.3f} dB per degree of local incidence on the relief (standard error "
    "{error_db_per_deg:.3f}), {of_simulated:.2f} times as much as the simulated image (standard error "
    "{of_simulated_error:.2f})",
    "place": "{about} does not show the place of the scene: the mean levels of its squares of {square_px:.0f} pixels "
    "have a correlation of {correlation:.2f} with those of the simulated image, and of up to {shifted:.2f} if it is "
    "shifted by two squares or more",
    "radiometry": "{about}: on the fixed materials the image agrees with {other}, not with {declared} as the case says "
    "(the image divided by {declared} of the fixed laws is proportional to the ground area of a pixel to the power "
    "{exponent:+.2f}, standard error {error:.2f}); the bands are given for {other}",
    "radiometry_unchecked": "{about}: radiometry unchecked, because the fixed materials do not show whether a pixel "
    "holds {declared} or {other}; the bands count {other} with a probability of {chance_percent:.0f} %",
    "fixed_law": "{about}: the image minus its fixed law is {error_db:+.2f} dB (90 %: {p05_db:+.2f} to "
    "{p95_db:+.2f}) after the level that all fixed materials share is subtracted",
    "fixed_law_and_image": "{about}: the image minus the fixed law is {apart_db:+.2f} dB (90 %: {p05_db:+.2f} to "
    "{p95_db:+.2f}); one fixed law cannot tell an error of the law from a level of the image",
    "level": "{about}: the image differs from the fixed laws by a level of {level_db:+.2f} dB that all fixed materials "
    "share (90 %: {p05_db:+.2f} to {p95_db:+.2f})",
    "fixed_level": "{about}: before the registration, the image minus the fixed law is roughly {apart_db:+.2f} dB "
    "(90 %: {p05_db:+.2f} to {p95_db:+.2f})",
    "level_of_image": "the level of the measured image is used as it is; no material with a fixed law checks it",
    "level_found": _FROM_REFERENCE,
    "level_subtracted": _FROM_REFERENCE + "; this offset is subtracted from the measured image",
    "images_mapped": _MAPPED,
    "all_images_mapped": _MAPPED + "; all materials are calibrated, so that a level common to all laws cannot be "
    "determined",
    "level_unchecked": "{about}: the level of the image (an offset in dB) is unchecked, because no material has a "
    "fixed law; the bands contain its standard error of {level_db:.2g} dB (uncertainty.level_db)",
    "determined": "sigma0 is determined to +-{half_width_db:.1f} dB (90 %) {between}, if scene, geometry and pixels "
    "are what the case says",
    "undetermined": "sigma0 is determined at no angle: the smallest half-width of its 90 % band is "
    "{narrowest_db:.2f} dB, and uncertainty.known_db asks for {known_db:.1f} dB",
    "withheld": "sigma0 is determined at no angle, because the image is refused",
    "level_only": "seen at one incidence, {incidence_deg:.1f} degrees, from which no law can be determined; "
    "sigma0 there is {median_db:.1f} dB (90 %: {p05_db:.1f} to {p95_db:.1f})",
    "parameters_only": "only the parameters have intervals, because the law has no curve in dB or the image is "
    "normalised; there is no band of sigma0",
    "without_cells": "sigma0 is determined at no angle, because too few of its pixels lie together: a cell "
    "needs 8 pixels in a square of 24 x 24 pixels and 3 degrees of incidence, and a pass needs 3 cells",
    "refuted": "the form of the law is refuted: it is wrong by {rms_db:.1f} dB (rms; 90 %: {p05_db:.1f} to "
    "{p95_db:.1f}), which the band contains",
    "form_noticed": "an error of the law's form is noticed, {rms_db:.1f} dB (rms; 90 %: {p05_db:.1f} to "
    "{p95_db:.1f}), which the band contains; the law is not refuted",
    "not_refuted": "the law is not refuted",
    "not_sampled": "{about}: the sampler has not converged (uncertainty.steps), so that the band is less certain",
    "in_the_noise": "{about}: {share:.0%} of its pixels are masked, because they are in the noise (target.snr_db); of "
    "the pixels near the noise, the brighter ones remain",
    "law_outside_band": "{about}: the law of the search (parameters) leaves the 90 % band of sigma0 by up to "
    "{beyond_db:.1f} dB (possible cause: {cause}); parameters_model gives the law nearest to the median of the band",
    "texture": "{about}: the search found {looks:.2f} effective looks, fewer than the {looks_nominal:.3g} of the "
    "simulated speckle; gamma texture in the simulation makes up the difference. Values between about 0.9 times "
    "radar.looks and radar.looks are no evidence of texture",
    "another_law": "sigma0 is determined at no angle, because the program's backscatter differs from law {law} by up "
    "to {difference_db:.1f} dB at the same X",
    "registration_moved": "{about}: a further registration, onto the calibrated image, would move the material's "
    "pixels by {moved_px:.1f} pixels (rms; standard error of the registration {stated_px:.1f}) and change their sigma0 "
    "by {moved_db:.1f} dB",
    # advice on a further pass
    "band_best": _NARROWS + "the band most, " + _TO_DB,
    "band_none": "{about}: no pass of the table is expected to narrow the band by a tenth; the best narrows it "
    + _TO_DB,
    "bands_best": _NARROWS + "the bands most, " + _TO_RATIO,
    "bands_none": "{about}: no pass of the table is expected to narrow the bands by a tenth; the best narrows them "
    + _TO_RATIO,
    "passes_equal": "{about}: these passes are within 5 % of the best: {names}",
    "opposite_side": "All passes have heading_deg {heading_deg:g}, because the passes of a case share one grid. A "
    "satellite that sees the scene from the other side with the same look side, half a day apart, heads to about "
    "{opposite_deg:.1f} deg: its image needs a case of its own (radar.heading_deg), which radcal apply compares with "
    "this one",
    # products of a forward run
    "gmti_detections": "{about}: {movers_in_reports:.0f} of {movers:.0f} movers are among the detections of half of "
    "the scans or more; {reports_of_movers:.0f} of {reports:.0f} detections are of a mover (rms error of their places "
    "{reports_rms_m:.0f} m). Without movers, a share of {alarms:.1e} of the tests are alarms ({asked:.1e} were asked "
    "for, in uniform clutter). The least detectable radial velocity is {least_mps:.1f} m/s. Displaced phase centres "
    "alone (DPCA) leave {dpca_db:.1f} dB of the ground's power",
    "gmti_tracks": "{about}: {movers_in_tracks:.0f} of {movers:.0f} movers have a track in half of the {scans:.0f} "
    "scans or more; {tracks_of_movers:.0f} of {tracks:.0f} tracks follow a mover (rms error of their places "
    "{tracks_rms_m:.0f} m)",
    "gmti_package": "{about}: no file is written, because the package {package} is missing: type pip install "
    "'radcal[{extra}]'",
    "file_left_out": "{about}: no file is written: {why}",
    "ppi_extrapolated": "{about}: the mast sees it at a median incidence of {median_deg:.1f} deg, {percent:.0f} % "
    "outside of the {low_deg:.1f} to {high_deg:.1f} deg at which its law {law!r} is known; there it is extrapolated",
    "ppi_detections": "{about}: without objects the detector reports a share of {alarms:.1e} of the cells ({asked:.1e} "
    "were asked for, in uniform clutter); with them it reports {detected:.0f} of {objects:.0f} visible objects",
}
"""Text of each code, to be formatted with ``about``, ``do`` and the numbers of the finding."""

_FURTHER = "find out which further pass is expected to narrow its band most"
_ADVISE = "radcal advise {case}"
STEPS: Mapping[str, tuple[str, str, str]] = {
    "refuted": (
        "another law",
        "choose another law for {about} (docs/laws.md), or divide its ground into several materials; the band contains "
        "the error of the law's form",
        "",
    ),
    "max_runs": ("more runs", "continue with more runs", "stop.max_runs: {max_runs}"),
    "max_hours": ("more time", "continue for longer", "stop.max_hours: {max_hours:g}"),
    "stagnation": ("more patience", "continue for longer without improvement", "stop.stagnation_runs: {idle}"),
    "unreachable": ("wider bounds", "widen materials.{about}.bounds: the target seems out of reach inside them", ""),
    "running": ("continue", "repeat the command that began the case", ""),
    "determined": ("use the law", "use the law, which is in the folder export, or " + _FURTHER, _ADVISE),
    "undetermined": ("another pass", _FURTHER, _ADVISE),
    "withheld": ("check the image", "remove the reason why the image is refused, and repeat the command", ""),
    "level_only": ("another incidence", "add a pass at another incidence; first " + _FURTHER, _ADVISE),
    "parameters_only": ("use the parameters", "use the parameters in the program that computes the law", ""),
    "another_law": ("law: external", "set materials.{about}.law: external, with the parameters of the program", ""),
    "without_cells": ("larger ground", "give the material larger connected ground in the scene, or smaller pixels", ""),
}
"""Next step by state of a material, or by the reason why its search ended: short words, clause, and what to paste."""
