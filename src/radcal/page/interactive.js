// Draws the figures of the element #plots (JSON: name to {data, layout}) into the elements with data-plot="name".
// The library is embedded once, in #plotly, and is unpacked when the first figure comes into view. Both elements are
// base64 of gzip.
(async () => {
  "use strict";
  if (!("DecompressionStream" in window)) return;
  const unpacked = (id) => {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent.trim()), (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const specs = JSON.parse(await unpacked("plots"));
  const [dark, print] = ["(prefers-color-scheme: dark)", "print"].map((query) => matchMedia(query));
  const LIGHTER = { "#000000": "#e4e9ef", "#0072B2": "#6cb8ea", "#7B3F9E": "#c59be0", "#F5F5F5": "#2a3440" };
  const STACKED = 560; // a figure that is narrower than this [px] has its panels below each other
  const BUTTONS = [["zoom2d", "pan2d", "resetScale2d", "toImage"]]; // plotly's own list has one that sends the data away
  const CONFIG = { displaylogo: false, modeBarButtons: BUTTONS, plotlyServerURL: "" };
  const drawn = new Set();
  let library, resized;

  const loaded = async () => {
    const element = document.createElement("script");
    element.textContent = await unpacked("plotly");
    document.head.append(element);
    return window.Plotly;
  };

  const coloured = (spec, light) =>
    JSON.parse(JSON.stringify(spec), (_, value) => (!light && LIGHTER[value]) || value);

  const laidOut = (layout, width, light) => {
    const [ink, line] = light ? ["#1c2430", "#dfe4ea"] : ["#e4e9ef", "#3a4552"];
    for (const key of Object.keys(layout).filter((name) => /^[xy]axis/.test(name))) {
      layout[key] = { gridcolor: line, zerolinecolor: line, linecolor: line, automargin: true, ...layout[key] };
    }
    if (width < STACKED) {
      layout.height *= layout.grid?.rows === 1 ? 0.8 * layout.grid.columns : 1.15; // room for the lines of the legend
      if (layout.grid?.rows === 1) layout.grid = { ...layout.grid, rows: layout.grid.columns, columns: 1 };
    }
    const font = { color: ink, size: width < STACKED ? 10 : 12 };
    const below = { orientation: "h", x: 0, y: 1, yanchor: "bottom", xanchor: "left" };
    const paper = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font };
    const hover = { bgcolor: light ? "#ffffff" : "#202833", font: { color: ink } };
    const margin = { l: 56, r: 12, t: 34, b: 44 };
    const modebar = { bgcolor: "rgba(0,0,0,0)", color: "#8a94a0", activecolor: ink };
    return { ...paper, legend: below, margin, modebar, hoverlabel: hover, hovermode: "closest", ...layout, width };
  };

  const show = (plotly, place) => {
    if (!place.clientWidth) return seen.observe(place); // hidden again
    const light = print.matches || !dark.matches;
    let canvas = place.querySelector(":scope > .drawn");
    if (!canvas) {
      place.replaceChildren(Object.assign(document.createElement("div"), { className: "drawn" }));
      canvas = place.firstChild;
      drawn.add(place);
    }
    const { data, layout } = coloured(specs[place.dataset.plot], light);
    const width = place.clientWidth;
    const bare = print.matches || width < STACKED;
    if (width < STACKED) for (const trace of data) if (trace.type === "heatmap") trace.showscale = false;
    plotly.react(canvas, data, laidOut(layout, width, light), { ...CONFIG, displayModeBar: bare ? false : "hover" });
  };

  const again = () => library?.then((plotly) => drawn.forEach((place) => show(plotly, place)));
  const places = () => [...document.querySelectorAll("[data-plot]")].filter((place) => specs[place.dataset.plot]);
  const atOnce = () => window.Plotly && places().forEach((place) => show(window.Plotly, place));
  dark.addEventListener("change", again);
  addEventListener("resize", () => {
    clearTimeout(resized);
    resized = setTimeout(again, 200);
  });
  print.addEventListener("change", atOnce); // paper does not wait
  const seen = new IntersectionObserver(
    async (entries) => {
      for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
        seen.unobserve(target);
        show(await (library ??= loaded()), target);
      }
    },
    { rootMargin: "300px" },
  );
  for (const place of places()) {
    const { layout } = coloured(specs[place.dataset.plot], true);
    // the page does not move later
    if (place.clientWidth) place.style.minHeight = `${laidOut(layout, place.clientWidth, true).height}px`;
    seen.observe(place);
  }
})();
