"use strict";
// Fetches the figures of a page when they come into view and draws them with plotly, in the colours
// of the theme. A figure that is still being computed (202, or Retry-After) is asked for again.

(() => {
  const meta = (name) => document.querySelector(`meta[name="${name}"]`).content;
  const inCss = (name) =>
    getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const NARROW_PX = 480;
  const PAPER = { width: 640, share: 0.75 }; // fits A4 and letter; so much of its height on screen
  const drawn = new Map(); // plot -> document
  let script = null;
  let onPaper = false; // while it is printed, a figure is light and no wider than paper
  let period = null; // what all time axes of the page show; null: each all of its own

  function plotly() {
    script ??= new Promise((resolve, reject) => {
      const tag = document.createElement("script");
      tag.src = meta("plotly");
      tag.onload = () => resolve(window.Plotly);
      tag.onerror = () => reject(new Error("The script that draws figures did not load."));
      document.head.append(tag);
    });
    return script;
  }

  const numbers = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)).join(",");

  function theme(light) {
    const turned = new Map();
    for (const pair of meta("palette").split(" ")) {
      const [name, code] = pair.split("=");
      const now = light ? code : inCss(name) || code;
      turned.set(code, now);
      turned.set(`rgba(${numbers(code)},`, `rgba(${numbers(now)},`);
    }
    return turned;
  }

  function inTheme(value, turned) {
    if (typeof value === "string") {
      if (value[0] === "#") return turned.get(value) ?? value;
      if (!value.startsWith("rgba(")) return value;
      const cut = value.lastIndexOf(",") + 1;
      return (turned.get(value.slice(0, cut)) ?? value.slice(0, cut)) + value.slice(cut);
    }
    if (Array.isArray(value)) {
      return typeof value[0] === "number" ? value : value.map((each) => inTheme(each, turned));
    }
    if (value && typeof value === "object") {
      return Object.fromEntries(
        Object.entries(value).map(([key, each]) => [key, inTheme(each, turned)]),
      );
    }
    return value;
  }

  function merged(under, over) {
    const found = { ...under };
    for (const [key, value] of Object.entries(over)) {
      const both = value && typeof value === "object" && !Array.isArray(value);
      found[key] = both && found[key] && typeof found[key] === "object"
        ? merged(found[key], value) : value;
    }
    return found;
  }

  function layoutOf(given, light, narrow, height) {
    const ink = light ? "#1d2330" : inCss("ink");
    const grid = light ? "#d5d9e0" : inCss("grid");
    const paper = light ? "#ffffff" : inCss("page");
    const size = narrow ? 11 : 13;
    const base = {
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: ink, family: "system-ui, sans-serif", size },
      margin: narrow ? { l: 48, r: 8, t: 30, b: 44 } : { l: 64, r: 16, t: 36, b: 52 },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom",
        font: { size } },
      hoverlabel: { bgcolor: paper, bordercolor: grid, font: { color: ink } },
    };
    const axis = { gridcolor: grid, linecolor: grid, zerolinecolor: grid, automargin: true,
      title: { font: { size } } };
    const axes = new Set(["xaxis", "yaxis"]);
    Object.keys(given).filter((key) => /^[xy]axis\d*$/.test(key)).forEach((key) => axes.add(key));
    for (const name of axes) base[name] = axis;
    const found = merged(base, given);
    if (period) for (const name of timeAxes(found)) found[name] = { ...found[name], range: period };
    delete found.width;
    found.autosize = true;
    if (!onPaper) return found;
    return { ...found, autosize: false, width: PAPER.width, height: PAPER.share * height };
  }

  const timeAxes = (layout) =>
    Object.keys(layout).filter((key) => /^xaxis\d*$/.test(key) && layout[key].type === "date");

  // Who enlarges a stretch of time in one figure sees it in all; a double click shows all again.
  function follow(plot, change) {
    const of = timeAxes(drawn.get(plot).layout ?? {}).find((name) =>
      [`${name}.range[0]`, `${name}.range`, `${name}.autorange`].some((key) => key in change));
    if (!of) return;
    const from = change[`${of}.range[0]`] ?? change[`${of}.range`]?.[0];
    const to = change[`${of}.range[1]`] ?? change[`${of}.range`]?.[1];
    show(from && to ? [from, to] : null);
  }

  function show(stretch) {
    period = stretch;
    for (const [plot, figure] of drawn) {
      if (timeAxes(figure.layout ?? {}).length) draw(plot, figure);
    }
  }

  // From when to when the time axes of all figures go, as they came.
  function extent() {
    const ranges = [...drawn.values()].flatMap(({ layout = {} }) =>
      timeAxes(layout).map((name) => (layout[name].range ?? []).map(Date.parse)));
    const known = ranges.filter((each) => each.length === 2 && each.every(Number.isFinite));
    if (!known.length) return [];
    const [first, last] = [Math.min(...known.map(([at]) => at)), Math.max(...known.map(([, at]) => at))];
    return [new Date(first).toISOString(), new Date(last).toISOString()];
  }

  function lastDays(days) {
    const [, end] = extent();
    if (end) show([new Date(Date.parse(end) - 86_400_000 * days).toISOString(), end]);
  }

  // The last days by a button, or any days by their dates; an empty date leaves that end open.
  function choosePeriod(form) {
    const { from, to } = form.elements;
    for (const button of form.querySelectorAll("button[data-days]")) {
      const days = Number(button.dataset.days);
      button.addEventListener("click", () => {
        form.reset();
        if (days) lastDays(days); else show(null);
      });
    }
    form.addEventListener("change", () => {
      const [first, last] = extent();
      const stretch = [from.value || first, to.value ? `${to.value}T23:59:59Z` : last];
      const isSpan = stretch[0] && stretch[0] < stretch[1];
      to.setCustomValidity(isSpan || !to.value ? "" : "The last day is before the first.");
      to.reportValidity();
      if (isSpan) show(stretch);
    });
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  async function draw(plot, figure) {
    const light = onPaper || !dark.matches;
    const turned = theme(light);
    const library = await plotly();
    const narrow = onPaper || plot.clientWidth < NARROW_PX;
    await library.react(plot, inTheme(figure.data, turned),
      layoutOf(inTheme(figure.layout ?? {}, turned), light, narrow, parseFloat(plot.style.height)),
      { responsive: true, displaylogo: false, scrollZoom: false,
        displayModeBar: narrow ? false : "hover", // on a phone it would cover the legend
        modeBarButtonsToRemove: ["lasso2d", "select2d"] });
    if (plot.dataset.follows) return;
    plot.dataset.follows = "yes";
    plot.on("plotly_relayout", (change) => follow(plot, change));
  }

  function tell(chart, text) {
    chart.querySelector(".told").textContent = text.replaceAll("`", "");
  }

  function describe(chart, figure) {
    if (figure.caption) chart.querySelector(".caption").textContent = figure.caption;
    const alternative = figure.alt ?? figure.caption;
    if (alternative) chart.querySelector(".plot").setAttribute("aria-label", alternative);
  }

  function visible() {
    if (!document.hidden) return Promise.resolve();
    return new Promise((resolve) => {
      document.addEventListener("visibilitychange", () => resolve(), { once: true });
    });
  }

  async function later(chart, seconds) {
    await new Promise((resolve) => { setTimeout(resolve, 1000 * seconds); });
    await visible();
    await load(chart);
  }

  async function load(chart) {
    const plot = chart.querySelector(".plot");
    if (!drawn.has(plot)) tell(chart, "Loading …");
    try {
      const answer = await fetch(chart.dataset.figure, { headers: { Accept: "application/json" } });
      const found = await answer.json();
      const again = Number(answer.headers.get("Retry-After")) || 0;
      if (!answer.ok) {
        tell(chart, [found.message, found.remedy].filter(Boolean).join(" ") || "No figure came.");
      } else if (answer.status === 202) {
        tell(chart, found.message ?? "Being computed …");
        later(chart, again || 2);
      } else {
        drawn.set(plot, found);
        describe(chart, found);
        tell(chart, found.message ?? "");
        await draw(plot, found);
        if (again) later(chart, again);
      }
    } catch (error) {
      tell(chart, `The figure cannot be shown: ${error.message} Its numbers stand below.`);
    }
  }

  function redraw() {
    for (const [plot, figure] of drawn) draw(plot, figure);
  }

  function print(begins) {
    onPaper = begins;
    redraw();
  }

  document.addEventListener("DOMContentLoaded", () => {
    const charts = document.querySelectorAll("figure.chart[data-figure]");
    if (!charts.length) return;
    const watcher = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        watcher.unobserve(target);
        load(target);
      }
    }, { rootMargin: "400px" });
    charts.forEach((chart) => watcher.observe(chart));
    document.querySelectorAll("form[data-period]").forEach(choosePeriod);
    dark.addEventListener("change", redraw);
    addEventListener("beforeprint", () => print(true));
    addEventListener("afterprint", () => print(false));
  });
})();
