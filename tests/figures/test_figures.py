"""Figures are there, complete and drawn without a warning, also at the edges."""

import json
import warnings
from dataclasses import replace

import h5py
import matplotlib as mpl
import numpy as np
import pytest
from archives import changed_material, changed_measurement, configured, posterior
from assessment_samples import held_cells
from matplotlib.text import Text
from scipy import stats

from radcal import skewnormal
from radcal.figures import drawing, map_figures, scene_figures
from radcal.figures import figures as module
from radcal.figures.density_figures import densities, overview
from radcal.figures.fidelity_figures import differences, fidelity
from radcal.figures.figures import write_figures
from radcal.figures.front_figures import front
from radcal.figures.held_out_figures import held_out
from radcal.figures.law_figures import cost, law
from radcal.posterior.result import LevelPoints
from radcal.results.archive import Fidelity, Images, SearchFront
from radcal.scene.objects import Objects

MANY = [f"material {n}" for n in range(13)] + ["a_name_" * 8, "two words", "two_words"]


@pytest.fixture(scope="module", autouse=True)
def _styled_without_warnings():
    with warnings.catch_warnings(), drawing.styled():
        warnings.simplefilter("error")
        yield


@pytest.fixture(scope="module")
def figures(made, tmp_path_factory):
    """Figures in files, of few pixels and with fonts that are not cut to their letters, which takes half as long.

    The small calibration writes them with the pixels and the fonts that users get.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(drawing.STYLE, "pdf.fonttype", 3)
        patch.setattr(module, "_DPI", 50)
        with mpl.rc_context({"text.usetex": True}):  # a user's matplotlibrc has no effect
            figures = write_figures(made.archive, tmp_path_factory.mktemp("case") / "figures")
        yield figures


def drawn(canvas):
    """Render a figure and return the texts that leave it."""
    canvas.draw_without_rendering()
    width, height = canvas.bbox.width, canvas.bbox.height
    outside = []
    texts = [t for axes in canvas.axes for t in (*axes.texts, axes.title, axes.xaxis.label, axes.yaxis.label)]
    texts += [t for axes in canvas.axes if axes.axison for t in axes.get_children() if isinstance(t, Text)]
    texts += [t for legend in canvas.legends for t in legend.get_texts()]
    for text in texts:
        if text and text.get_text():
            box = text.get_window_extent()
            if box.x0 < -1 or box.y0 < -1 or box.x1 > width + 1 or box.y1 > height + 1:
                outside.append(text.get_text())
    return outside


def shown(figure):
    """Canvas, caption and text of a figure, which no text leaves."""
    assert drawn(figure[0]) == []
    return figure


def all_drawn(archive, material):
    """Caption of each figure of the archive and of a material, which no text leaves."""
    of_case, of_material = "images residual scene incidence", "densities law cost histogram quality"
    found = {name: getattr(module, name)(archive) for name in of_case.split()}
    found |= {name: getattr(module, name)(archive, material) for name in of_material.split()}
    assert {name: drawn(canvas) for name, (canvas, _, _) in found.items()} == {name: [] for name in found}
    return {name: caption for name, (_, caption, _) in found.items()}


@pytest.mark.slow
def test_every_figure_as_png_and_pdf(figures):
    names = [figure.name for figure in figures]
    kinds = ("densities", "law", "cost", "fidelity", "histogram", "quality")
    assert names[:5] == ["scene", "incidence", "images", "residual", "overview"]
    assert names[5:] == [f"{kind}_{m}" for m in ("dyke", "stem_beans") for kind in kinds]
    folder = figures[0].png.parent
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        f"{name}.{ending}" for name in names for ending in ("png", "pdf")
    )
    for figure in figures:
        assert figure.png.read_bytes().startswith(b"\x89PNG")
        pdf = figure.pdf.read_bytes()
        assert pdf.startswith(b"%PDF")
        assert b"CreationDate" not in pdf
        assert figure.title
        assert figure.caption
        assert figure.alt
    assert {figure.material for figure in figures} == {None, "dyke", "stem beans"}


def test_captions_tell_the_texture_of_the_densities(made):
    bins = configured(made.archive, objective="classes")
    for archive, told in ((bins, True), (made.archive, False)):
        for caption in (overview(archive)[1], densities(archive, "dyke")[1]):
            assert ("the texture that makes its run fit best" in caption) is told


@pytest.mark.slow
def test_registration_is_shown_where_the_image_was_moved(build_archive, tmp_path, made, monkeypatch):
    assert module.registration(made.archive) is None
    archive = build_archive(tmp_path, moved=True, nan=True).archive

    def rendered(canvas, path):
        """The picture without its files, which take most of the time and are another test's."""
        if path.name == "registration.png":
            assert drawn(canvas) == []
        return path

    monkeypatch.setattr(module, "_save", rendered)
    archive = changed_material(archive, "dyke", posterior=posterior(held=held_cells()))
    figures = {figure.name: figure for figure in write_figures(archive, tmp_path / "figures")}
    assert list(figures)[2:5] == ["images", "registration", "residual"]
    assert [name for name in figures if name.startswith("held_out")] == ["held_out_dyke"]
    # 0.5 pixels off in both directions
    assert "the mean error is 0.71 pixels" in figures["registration"].caption
    assert "the longest arrow stands for 2.1 pixels" in figures["registration"].caption


def test_the_users_matplotlibrc_has_no_effect(tmp_path):
    """A user may typeset texts by LaTeX, which need not be installed here and fails on names such as a_b."""

    def panels(path, users):
        with mpl.rc_context(users), drawing.law_panels(path, ["a_b"], "sigma0 [dB]") as each:
            for axes, _ in each:
                axes.plot([20.0, 40.0], [-7.0, -12.0], label="law")
        return path.read_bytes()

    users = {"text.usetex": True, "lines.linewidth": 7.0, "savefig.bbox": "tight", "figure.facecolor": "red"}
    assert panels(tmp_path / "a.png", users) == panels(tmp_path / "b.png", {})


@pytest.mark.slow
def test_edges_of_one_material(build_archive, tmp_path):
    shifts = {"dyke": {"reference": [0.0], "design": [5.0, 0.0, 2000.0], "infill": []}}
    case = build_archive(tmp_path, shifts=shifts, hidden=(), shape=(300, 20), nan=True, omega=0.02).archive
    captions = all_drawn(case, "dyke")
    assert "measured pixels have no value" in captions["images"]
    assert "have an rms of 0" in captions["cost"]


@pytest.mark.slow
def test_only_laws_with_a_curve_are_drawn(build_archive, tmp_path):
    case = build_archive(tmp_path, external=True).archive
    assert module.law(case, "dyke") is None
    assert module.law(case, "stem beans") is not None
    canvas, _, _ = module.incidence(case)
    # levels of the law that has a curve, none of the other's
    assert np.isnan(canvas.axes[1].images[0].get_array().filled(np.nan)[case.images.material == 1]).all()


@pytest.mark.parametrize(("references", "others"), [(1, []), (2, ["dyke"])])
def test_the_best_run_is_never_one_of_another_law(build_archive, tmp_path, others, references):
    """The reference run meets every target; it counts only where it is of the law that is calibrated."""
    numbers = {"reference": [1e-9] * references, "design": [5.0, -6.0, 2.0], "infill": [0.2]}
    made = build_archive(tmp_path, shifts={"dyke": numbers, "stem beans": numbers}, floors={}, other_start=others)
    case = made.archive
    for name, material in case.materials.items():
        canvas, _, _ = module.cost(case, name)
        (best,) = [line for line in canvas.axes[0].lines if line.get_label() == "best so far"]
        start = references if name in others else 0
        np.testing.assert_array_equal(best.get_xdata(), np.arange(start, references + 4))
        expected = np.minimum.accumulate([made.history.runs[k].scores[name].rms for k in best.get_xdata()])
        np.testing.assert_allclose(best.get_ydata(), expected)
        assert material.best == (references + 3 if name in others else 0)


@pytest.mark.slow
def test_many_materials(build_archive, tmp_path):
    numbers = {"reference": [8.0], "design": [4.0] * 12}
    shifts = {name: {**numbers, "infill": [2.0, 10.0**-n]} for n, name in enumerate(MANY)}
    floors = {MANY[13]: [None, 0.05]}
    case = build_archive(tmp_path, shifts=shifts, hidden=MANY[:2], floors=floors, shape=(34, 340)).archive
    slugs = list(drawing.slugs(case.materials))
    assert len({slug.lower() for slug in slugs}) == len(MANY)
    assert {"two_words", "two_words_2"} <= set(slugs)
    assert "" not in all_drawn(case, MANY[13]).values()
    assert drawn(overview(case)[0]) == []


@pytest.mark.slow
def test_images_without_a_value_or_missing(made):
    blank = np.full_like(made.archive.measured_db, np.nan)
    case = changed_measurement(made.archive, blank)
    case = replace(case, images=replace(case.images, reference_db=None))
    for canvas, _, _ in (module.images(case), module.residual(case)):
        assert drawn(canvas) == []
    assert module.residual(replace(made.archive, images=Images())) is None


@pytest.mark.parametrize(("shift_db", "own"), [(-1.0, False), (-25.0, True), (25.0, True)])
def test_a_start_far_from_the_measured_level_has_a_gray_scale_of_its_own(made, shift_db, own):
    measured = np.random.default_rng(5).normal(-12.0, 3.0, (60, 50))
    images = replace(made.archive.images, reference_db=measured + shift_db, calibrated_db=measured[::-1])
    case = replace(changed_measurement(made.archive, measured), images=images)
    canvas, caption, alt = shown(module.images(case))
    limits = [axes.images[0].get_clim() for axes in canvas.axes[:3]]
    low, high = np.percentile(measured, [1.0, 99.5])
    np.testing.assert_allclose([limits[0], limits[2]], [[low, high]] * 2)
    np.testing.assert_allclose(limits[1], np.array([low, high]) + shift_db * own)
    text = canvas.axes[1].get_title("left")
    title = f"start, own scale:\n{low + shift_db:.0f} to {high + shift_db:.0f} dB" if own else "start"
    assert text == title
    assert ("scale of its own, given in its title" in caption) is own
    assert ("gray scale of its own" in alt) is own


def test_large_images_are_averaged_in_power(monkeypatch):
    monkeypatch.setattr(map_figures, "_LARGEST", 4)
    image = np.full((8, 7), 10.0)
    image[:2, :2] = [[0.0, np.nan], [np.nan, np.nan]]
    image[2:4, :2] = np.nan
    shown = map_figures._shown(image)
    assert shown.shape == (4, 3)
    assert shown[0, 0] == pytest.approx(0.0)
    assert np.isnan(shown[1, 0])
    assert shown[2:] == pytest.approx(10.0)


@pytest.mark.slow
def test_objects_are_dots_in_the_scene(made, tmp_path):
    places = np.random.default_rng(3).uniform(0.0, 100.0, (2, 45_001))
    n = places.shape[1]
    zero = np.zeros(n)
    objects = Objects(*places, zero, zero, zero, zero, zero, np.full(n, -1, np.int16))
    path = tmp_path / "calibration.h5"
    case = made.gathered(path, scene=replace(made.scene, objects=objects))
    with h5py.File(path) as file:
        np.testing.assert_allclose(file["scene/objects_m"], places.T[::3], rtol=1e-6)
    canvas, caption, _ = module.scene(case)
    assert not drawn(canvas)
    dots = [line for axes in canvas.axes for line in axes.lines if line.get_marker() == ","]
    assert len(dots) == 1
    np.testing.assert_allclose(dots[0].get_xydata(), places.T[::3] / 1000.0, rtol=1e-6)
    assert "Objects are dots" in caption
    plain, caption, _ = module.scene(made.archive)
    assert not any(axes.lines for axes in plain.axes if axes.get_title("left") == "materials")
    assert "Objects" not in caption


def test_axes_of_a_turned_scene_are_those_of_the_track(made):
    radar = {**json.loads(made.archive.config)["radar"], "heading_deg": 192.5}
    rows, columns = np.indices((20, 30))
    hilly = (100.0 + 4.0 * rows * np.sin(columns / 4.0)).astype(np.float32)
    view = replace(made.archive.scene, material=np.ones((20, 30), np.uint8), elevation_m=hilly, cell_m=15.0)
    case = replace(made.archive, scene=view)
    turned, caption, _ = module.scene(configured(case, radar=radar))
    plain, _, _ = module.scene(case)
    assert drawn(turned) == []
    for canvas, across, along in (
        (turned, "right of the track [km]", "along the track, 192.5 deg [km]"),
        (plain, "east [km]", "north [km]"),
    ):
        labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in canvas.axes if axes.get_xlabel()]
        assert labels == [(across, along)] * 3
    assert "comes from ahead on the left" in caption


def arrows_of(axes):
    """Direction of each arrow of a map, to the right and upwards."""
    names = ("N", "flight", "look")
    return {one.get_text(): one.xyann / np.hypot(*one.xyann) for one in axes.texts if one.get_text() in names}


@pytest.mark.parametrize(
    ("heading_deg", "side", "north", "look"), [(0.0, "right", (0, 1), 1), (30.0, "left", (-0.5, 0.75**0.5), -1)]
)
def test_maps_show_north_flight_and_look(made, heading_deg, side, north, look):
    """A grid of heading 30 degrees points along the track, so that north lies 30 degrees to the left of its rows."""
    radar = {**json.loads(made.archive.config)["radar"], "heading_deg": heading_deg, "look_side": side}
    case = configured(made.archive, radar=radar)
    canvas, _, _ = shown(module.scene(case))
    (plan,) = [axes for axes in canvas.axes if axes.get_title("left") == "materials"]
    for name, expected in {"N": north, "flight": (0, 1), "look": (look, 0)}.items():
        np.testing.assert_allclose(arrows_of(plan)[name], expected, atol=1e-12)
    for draw in (module.images, module.incidence, module.residual):
        canvas, _, _ = draw(case)
        found = arrows_of(canvas.axes[0])
        # columns of an image lie along azimuth, and its rows, the first on top, along range
        assert (tuple(found["flight"]), tuple(found["look"])) == ((1.0, 0.0), (0.0, -1.0))


def test_a_scene_on_the_map_has_coordinates(made):
    placed = replace(made.archive.scene, crs="EPSG:32631", west_m=612_345.0, south_m=5_801_000.0)
    canvas, caption, _ = module.scene(replace(made.archive, scene=placed))
    plain = module.scene(made.archive)[0]
    wide, high = (np.ptp(ends) for ends in (plain.axes[0].get_xlim(), plain.axes[0].get_ylim()))
    np.testing.assert_allclose(canvas.axes[0].get_xlim(), [612.345, 612.345 + wide])
    np.testing.assert_allclose(canvas.axes[0].get_ylim(), [5801.0, 5801.0 + high])
    assert "WGS 84 / UTM zone 31N" in caption


def test_the_ground_is_hatched_where_its_law_is_determined(made):
    """The incidence grows from row to row; both laws are determined from 22.25 to 39.5 degrees."""
    canvas, caption, _ = shown(module.incidence(made.archive))
    assert "Hatched: ground whose incidence" in caption
    (areas,) = [one for one in canvas.axes[0].collections if one.get_hatch() or hasattr(one, "hatches")]
    rows = areas.get_paths()[0].vertices[:, 1]
    angle, material = made.archive.images.incidence_deg, made.archive.images.material
    calibrated = np.isin(material, [made.archive.names.index(name) + 1 for name in made.archive.materials])
    inside = np.flatnonzero(((angle >= 22.25) & (angle <= 39.5) & calibrated).all(axis=1))
    assert (rows.min(), rows.max()) == pytest.approx((inside[0], inside[-1]), abs=1.5)
    nowhere = posterior(known_between_deg=None)
    case = made.archive
    for name in case.materials:
        case = changed_material(case, name, posterior=nowhere)
    assert "Hatched" not in module.incidence(case)[1]


def test_objects_in_a_field_are_no_borders_of_it(made):
    """Two fields, of which the left one has a pixel without a material in every 4 x 4."""
    material = np.ones((90, 120), np.uint8)
    material[:, 80:] = 2
    material[30:60, 80:] = 1  # without objects
    material[1::4, 1:80:4] = 0
    row, column = map_figures._middle(material, 1)
    assert (row, column) == pytest.approx((45, 60), abs=16)
    # of a determined material, every second column has objects
    number = made.archive.names.index(next(iter(made.archive.materials))) + 1
    material = np.full((90, 120), number, np.uint8)
    material[:, ::2] = 0
    angle = np.full(material.shape, 30.0, np.float32)
    images = replace(made.archive.images, material=material, incidence_deg=angle)
    canvas, *_ = module.incidence(replace(made.archive, images=images))
    (areas,) = [one for one in canvas.axes[0].collections if hasattr(one, "hatches")]
    (path,) = areas.get_paths()
    assert np.count_nonzero(path.codes == path.MOVETO) == 1
    assert np.ptp(path.vertices, axis=0) == pytest.approx((119, 89))


def test_measured_levels_are_drawn(made):
    levels = np.array([-9.0, -12.0])
    points = LevelPoints(np.array([25.0, 35.0]), levels, np.array([0.5, 0.8]), np.stack([levels] * 3, axis=1), 0.5)
    case = changed_material(made.archive, "dyke", posterior=posterior(points=points))
    canvas, caption, _ = shown(law(case, "dyke"))
    assert "Dots" in caption
    # bars of 95 %
    (bars,) = [one for one in canvas.axes[0].containers if one.get_label() == "measured levels, 95 %"]
    wanted = ((25.0, -9.98, -8.02), (35.0, -13.568, -10.432))
    for segment, (angle, low, high) in zip(bars[2][0].get_segments(), wanted, strict=True):
        np.testing.assert_allclose(segment, [[angle, low], [angle, high]])
    assert "Dots" not in law(case, "stem beans")[1]


def test_runs_after_the_end_of_a_materials_search_are_a_kind_of_their_own(made):
    """The search of the dyke ends with its last run of the design, and one run is made for other materials."""
    material = made.archive.materials["dyke"]
    case = changed_material(made.archive, "dyke", fidelity=replace(material.fidelity, mode=("exploit", "ended")))
    canvas, _, _ = cost(case, "dyke")
    dots = {one.get_label(): one.get_offsets().data[:, 0].tolist() for one in canvas.axes[0].collections}
    assert dots["infill after it ended"] == [6.0]
    assert dots["infill"] == [5.0]


def test_densities_of_a_histogram_are_those_of_design_runs(made):
    canvas, _, _ = module.histogram(made.archive, "dyke")
    curves = [line for line in canvas.axes[0].lines if line.get_color() == drawing.DESIGN]
    found = [np.average(line.get_xdata(), weights=line.get_ydata()) for line in curves]
    dp = [run.scores["dyke"].dp for run in made.history.runs if run.kind == "design"]
    np.testing.assert_allclose(found, [skewnormal.centred(one)[0] for one in dp], atol=0.02)
    kinds = np.where(made.archive.runs.kind == "design", "infill", made.archive.runs.kind)
    assert module.histogram(replace(made.archive, runs=replace(made.archive.runs, kind=kinds)), "dyke") is None


def test_quantiles_and_their_band_are_scipys(made):
    """Places (k + 1/2) / n of the fitted density; order statistics of 100 values have beta laws."""
    material = made.archive.materials["dyke"]
    xi, omega, alpha = material.target.dp
    fitted = stats.skewnorm(alpha, xi, omega)
    canvas, _, _ = module.quality(made.archive, "dyke")
    (axes,) = canvas.axes
    (dots,) = [line for line in axes.lines if line.get_label() == "measured pixels"]
    n = material.target.values_db.size
    np.testing.assert_allclose(dots.get_xdata(), fitted.ppf((np.arange(n) + 0.5) / n), atol=0.01)
    np.testing.assert_array_equal(dots.get_ydata(), np.sort(material.target.values_db))
    (band,) = axes.collections
    edges = {tuple(row) for row in np.round(band.get_paths()[0].vertices, 1)}
    for rank in (3, 50, 99):
        for tail in (0.025, 0.975):
            edge = fitted.ppf([(rank - 0.5) / 100, stats.beta(rank, 101 - rank).ppf(tail)])
            assert tuple(np.round(edge, 1)) in edges


def test_a_surrogate_is_judged_by_verified_minus_predicted():
    one = np.array([[[2.0, 0.5, -1.0]], [[1.0, 1.0, 1.0]]])
    error = np.array([[[0.5, 0.1, 2.0]], [[0.0, 0.0, 0.0]]])
    found = differences(Fidelity(("exploit",) * 2, np.zeros(2), np.zeros(2), one, error, one + 1.0, np.zeros((2, 3))))
    np.testing.assert_allclose(found, [[[2.0, 10.0, 0.5]], [[np.nan] * 3]])


def test_the_front_is_drawn_with_the_runs_and_the_chosen_one(made):
    """Of three objectives, the first against each of the others; a run of another law has no place."""
    case = made.archive
    assert front(case, "dyke") is None
    count = case.runs.kind.size
    verified = np.geomspace(900.0, 9.0, 3 * count).reshape(count, 3)
    verified[0] = np.nan
    predicted = np.array([[4.0, 9.0, 12.0], [2.0, 30.0, 10.5], [8.0, 5.0, 9.0]])
    names = ("pass 1", "pass 2", "pass 4")
    found = SearchFront(names, predicted, verified)
    case = changed_material(case, "dyke", front=found, best=count - 1)
    canvas, caption, _ = shown(front(case, "dyke"))
    for axes, other in zip(canvas.axes, (1, 2), strict=True):
        (line,) = axes.lines
        np.testing.assert_array_equal(line.get_xydata(), predicted[[1, 0, 2]][:, [0, other]])
        dots = {one.get_label(): one.get_offsets().data for one in axes.collections}
        np.testing.assert_array_equal(dots["chosen run"], verified[-1:, [0, other]])
        np.testing.assert_array_equal(dots["infill"], verified[case.runs.kind == "infill"][:, [0, other]])
        assert "reference (start)" not in dots
        # runs of the design lie far from the front
        assert "design" not in dots
        assert axes.get_ylabel() == f"squared residuals: {names[other]}"
        for ticks, (low, high) in ((axes.get_xticks(), axes.get_xlim()), (axes.get_yticks(), axes.get_ylim())):
            assert np.count_nonzero((ticks >= low) & (ticks <= high)) >= 2
    assert f"run are {verified[-1, 0]:.2g} (pass 1), {verified[-1, 1]:.2g} (pass 2)" in caption


def test_speckle_of_the_mean_over_a_window_is_said(made):
    """Of two images of 4 looks: the root of twice trigamma(4), 0.284, in dB, over 9."""
    _, caption, _ = module.residual(made.archive)
    assert "deviation of 0.36 dB, and more where" in caption


def test_residuals_are_means_where_a_quarter_of_the_window_has_values():
    rows, columns = np.indices((36, 36))
    half, few = ((rows + columns) % 2 == 0), (rows % 3 == 0) & (columns % 3 == 0)
    for valid in (half, few):
        found = map_figures._smoothed(np.where(valid, 2.5, np.nan), None)
        inside = np.zeros(valid.shape, dtype=bool)
        inside[9:-9, 9:-9] = True
        np.testing.assert_array_equal(np.isfinite(found[inside]), valid[inside] if valid is half else False)
    np.testing.assert_allclose(map_figures._smoothed(np.where(half, 2.5, np.nan), None)[half & inside], 2.5)


@pytest.mark.parametrize(("rise_m", "heights"), [(0.0, "120.0 to 120.0 m"), (0.04, "120.0 to 121.2 m")])
def test_a_scene_without_relief_has_plans_of_materials_and_heights_only(made, rise_m, heights):
    level = np.tile(120.0 + rise_m * np.arange(30.0), (20, 1)).astype(np.float32)
    view = replace(made.archive.scene, material=np.ones((20, 30), np.uint8), elevation_m=level, cell_m=15.0, step=1)
    canvas, caption, _ = shown(scene_figures.scene(replace(made.archive, scene=view)))
    assert f"heights from {heights}." in caption
    assert [axes.get_title("left") for axes in canvas.axes][:2] == ["materials", "elevation"]
    assert len(canvas.axes) == 3  # with the colour bar


@pytest.mark.parametrize(("rise_m", "title"), [(0.0, "imagery"), (4.0, "shaded imagery")])
def test_imagery_is_shown_and_shaded_on_relief(made, rise_m, title):
    # a ridge along the columns: its western slope is lit, where it has relief
    ridge = np.tile(120.0 + rise_m * -np.abs(np.arange(30.0) - 15.0), (20, 1)).astype(np.float32)
    imagery = np.full((20, 30, 3), (200, 128, 40), np.uint8)
    view = replace(made.archive.scene, material=np.ones((20, 30), np.uint8), elevation_m=ridge, cell_m=15.0, step=1)
    canvas, caption, alt = scene_figures.scene(replace(made.archive, scene=replace(view, imagery=imagery)))
    panel = canvas.axes[2]
    assert panel.get_title("left") == title
    assert "Imagery: visible light" in caption
    assert alt == f"Material map, elevation map, {title}."
    shown = np.asarray(panel.images[0].get_array())
    lit, dark = shown[:, 3:12].mean(axis=(0, 1)), shown[:, 18:27].mean(axis=(0, 1))
    if not rise_m:
        assert lit == pytest.approx(np.array([200, 128, 40]) / 255)
        assert dark == pytest.approx(lit)
    else:
        assert (lit > 1.3 * dark).all()
        # grey has the brightness of the shaded relief
        canvas, *_ = scene_figures.scene(replace(made.archive, scene=view))
        relief = np.asarray(canvas.axes[2].images[0].get_array())
        assert np.abs(shown[..., 1] - relief).max() < 0.01


def test_one_incidence_has_the_middle_of_a_scale():
    assert scene_figures._scale(np.linspace(31.0, 45.0, 101)) == pytest.approx((31.14, 44.86))
    assert scene_figures._scale(np.linspace(38.9, 39.1, 101)) == pytest.approx((38.902, 39.098))
    assert scene_figures._scale(np.full(50, 38.75)) == pytest.approx((38.745, 38.755))


@pytest.mark.parametrize(
    ("angles", "view"),
    [((38.9, 39.1), (33.0, 45.0)), ((22.0, 45.0), (0.0, 68.0)), ((29.4, 60.0), (0.0, 85.0))],
)
def test_the_axis_of_a_law_is_about_the_angles_seen_and_all_curves_end_with_it(made, angles, view):
    case = changed_material(made.archive, "dyke", posterior=posterior(seen_deg=np.array([angles])))
    canvas, *_ = law(case, "dyke")
    upper = canvas.axes[0]
    assert upper.get_xlim() == view
    assert canvas.axes[-1].get_xlim() == view
    band = upper.collections[0].get_paths()[0].vertices[:, 0]
    lines = [line.get_xdata() for line in upper.lines if line.get_linewidth() == 0.8]
    assert lines
    for one in [band, *lines]:
        assert (one.min(), one.max()) == view


def proposals(costs, values):
    """Proposals of two infill runs with the same statistics as their runs."""
    nothing = np.zeros((2, 3))
    return Fidelity(("exploit",) * 2, np.array(costs), np.full(2, np.nan), values, values + 1.0, values, nothing)


def test_predicted_and_verified_misfit_have_the_scale_of_the_figure_of_the_runs(made):
    values = np.array([[[0.1, 0.2, 0.3]], [[0.3, 0.1, 0.2]]])
    found = proposals([9.0, 7.5], values)
    costs = np.where(made.archive.runs.kind == "infill", [*[9.0] * 5, 8.0, 7.0], 9.0)
    case = changed_material(made.archive, "dyke", fidelity=found, cost=costs)
    canvas, caption, _ = shown(fidelity(configured(case, objective="classes"), "dyke"))
    density, words, _ = fidelity(case, "dyke")
    upper, other = canvas.axes[0], density.axes[0]
    assert upper.get_ylabel() == "squared residuals,\npriors included"
    assert caption.startswith("Above: for each infill run, squared residuals, priors included, as predicted")
    np.testing.assert_allclose([line.get_ydata() for line in upper.lines], [[18.0, 15.0], [16.0, 14.0]])
    np.testing.assert_allclose([line.get_ydata() for line in other.lines], [[9.0, 7.5], [8.0, 7.0]])
    assert words.startswith("Above: for each infill run, densities, rms [1/dB], as")


def test_a_surrogate_without_statistics_has_no_empty_panel(made):
    """One of the parameters of the density (``surrogate.outputs: direct``)."""
    found = replace(proposals([9.0, 7.5], np.zeros((2, 1, 3))), predicted=np.full((2, 1, 3), np.nan))
    case = changed_material(made.archive, "dyke", fidelity=found)
    canvas, caption, _ = fidelity(configured(case, surrogate={"outputs": "direct"}), "dyke")
    (axes,) = canvas.axes
    assert [text.get_text() for text in canvas.legends[0].get_texts()] == ["predicted", "verified"]
    assert axes.get_xlabel() == "run (0: reference)"
    assert caption.startswith("For each infill run, densities, rms [1/dB], as predicted")
    assert caption.endswith("(leave-one-out Q2): xi 0.00, omega 0.00, alpha 0.00.")


def test_an_infill_run_without_prediction_is_left_out_and_named(made):
    values = np.array([[[0.1, 0.2, 0.3]], [[0.3, 0.1, 0.2]]])
    first, second = np.flatnonzero(made.archive.runs.kind == "infill")
    case = changed_material(made.archive, "dyke", fidelity=proposals([9.0, np.nan], values))
    canvas, caption, _ = fidelity(case, "dyke")
    for line in canvas.axes[0].lines:
        np.testing.assert_array_equal(line.get_xdata(), [first])
    assert f"Without prediction, and not drawn: run {second}." in caption


def test_held_out_cells_are_drawn_as_measured_and_as_each_predicts_them(made):
    assert held_out(made.archive, "dyke") is None
    cells = held_cells()
    case = changed_material(made.archive, "dyke", posterior=posterior(held=cells))
    canvas, caption, alt = held_out(case, "dyke")
    (axes,) = canvas.axes
    drawn = {line.get_label(): line for line in axes.lines}
    assert {label: line.get_ydata().tolist() for label, line in drawn.items()} == {
        "law alone": [-9.0, -10.0, -11.0],
        "constant alone": [-13.0] * 3,
        "predicted": [-11.0, -11.5, -12.0],
        "measured": [-9.6, -10.5, -14.5],
    }
    assert all(line.get_xdata().tolist() == [25.0, 30.0, 40.0] for line in drawn.values())
    (band,) = axes.collections
    np.testing.assert_allclose(
        band.get_segments(), [[[25, -12.05], [25, -8.75]], [[30, -12.8], [30, -9.0]], [[40, -13.3], [40, -9.5]]]
    )
    assert len({line.get_marker() for line in drawn.values()}) == 4
    assert "Mean power of 3 held-out cells" in caption
    assert "1.75 dB (2.07 dB and 2.59 dB by law and constant alone), and 67 % of the held-out cells" in caption
    assert "dyke" in alt
