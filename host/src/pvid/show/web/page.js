// Asks for the state (page_state.py), draws it, and asks again: at most twice a second, and never before the last one
// is drawn.
"use strict";

const PERIOD_MS = 500;
const RETRY_MS = 2000;
const NOTHING_BELOW = 3e-5; // of kappa: trust.h

const place = (id) => document.getElementById(id);
const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const plots = new Map(); // id: {chart, spec, zoomed, figure}
let paused = false;
let shown = null; // the newest state
let marks = { t: [], rejected: [] };

function say(id, text, kind = "") {
  place(id).textContent = text;
  place(id).className = kind;
}

// ---- one plot: {id, section, label, data: [t, ...], series: [...], bands, limits, log, marked}

function axis(more) {
  return { stroke: color("text"), grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("grid"), size: 4 }, font: "11px system-ui", ...more };
}

function scaleOfTime(plot) {
  return (chart, low, high) => {
    if (plot.zoomed !== null) return plot.zoomed;
    const range = Number(place("range").value);
    return range > 0 && high !== null ? [Math.max(low, high - range), high] : [low, high];
  };
}

function scaleOfValue(plot) {
  return (chart, low, high) => {
    const { limits, log } = plot.spec;
    if (limits) return limits;
    if (low === null || high === null) return log ? [1e-6, 1] : [0, 1];
    if (log) return uPlot.rangeLog(low, high, 10, true);
    return low === high ? [low - 1, high + 1] : uPlot.rangeNum(low, high, 0.1, true);
  };
}

function drawMarks(chart, plot) {
  if (!plot.spec.marked) return;
  const { ctx, bbox } = chart;
  ctx.save();
  marks.t.forEach((t, i) => {
    const x = chart.valToPos(t, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    ctx.fillStyle = color(marks.rejected[i] ? "red" : "orange");
    ctx.fillRect(x - devicePixelRatio, bbox.top + bbox.height - 8 * devicePixelRatio, 2 * devicePixelRatio, 8 * devicePixelRatio);
  });
  ctx.restore();
}

function digits(chart, value) {
  return value === null || value === undefined ? "--" : String(Number(value.toPrecision(6)));
}

// On a logarithmic axis the powers of ten alone.
function tickText(value, log) {
  if (value === null) return "";
  if (!log) return String(Number(value.toPrecision(7)));
  const power = Math.round(Math.log10(value));
  return Math.abs(value / 10 ** power - 1) < 1e-6 ? `1e${power}` : "";
}

// As wide as its longest label.
function widthOfLabels(chart, all, k, cycle) {
  if (cycle > 1) return chart.axes[k]._size;
  chart.ctx.font = chart.axes[k].font[0];
  return Math.ceil(12 + Math.max(20, ...(all ?? []).map((one) => chart.ctx.measureText(one).width / devicePixelRatio)));
}

function options(plot, canvas) {
  const { spec } = plot;
  return {
    width: Math.max(100, canvas.clientWidth), height: Math.max(80, canvas.clientHeight - 22),
    scales: {
      x: { time: false, range: scaleOfTime(plot) },
      y: { range: scaleOfValue(plot), ...(spec.log ? { distr: 3 } : {}) },
    },
    axes: [axis({ size: 28, space: 70 }), axis({ size: widthOfLabels, values: (chart, all) => all.map((one) => tickText(one, spec.log)) })],
    series: [{ label: "t [s]", value: digits }, ...spec.series.map(({ colour, ...one }) => ({ width: 1.5, points: { show: false }, value: digits, stroke: colour && color(colour), spanGaps: false, ...one }))],
    bands: (spec.bands ?? []).map((pair) => ({ series: pair, fill: color("band") })),
    cursor: { sync: { key: "time", scales: ["x", null] }, points: { size: 6 }, drag: { x: true, y: false } },
    legend: { live: true },
    hooks: {
      draw: [(chart) => drawMarks(chart, plot)],
      setSelect: [(chart) => {
        const { left, width } = chart.select;
        if (width > 0) plot.zoomed = [chart.posToVal(left, "x"), chart.posToVal(left + width, "x")];
      }],
    },
  };
}

function download(name, url) {
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
}

function savePicture(plot) {
  const from = plot.chart.ctx.canvas, ratio = devicePixelRatio, to = document.createElement("canvas");
  to.width = from.width;
  to.height = from.height + 24 * ratio;
  const ctx = to.getContext("2d");
  ctx.fillStyle = color("back");
  ctx.fillRect(0, 0, to.width, to.height);
  ctx.fillStyle = color("text");
  ctx.font = `${13 * ratio}px system-ui`;
  ctx.fillText(plot.spec.label, 8 * ratio, 17 * ratio);
  ctx.drawImage(from, 0, 24 * ratio);
  download(`${plot.spec.id}.png`, to.toDataURL("image/png"));
}

function asCsv(plot) {
  const { min, max } = plot.chart.scales.x;
  const quoted = (text) => `"${String(text).replaceAll('"', '""')}"`;
  const rows = [["t [s]", ...plot.spec.series.map((one) => one.label ?? plot.spec.label)].map(quoted).join(",")];
  plot.spec.data[0].forEach((t, i) => {
    if (t >= min && t <= max) rows.push(plot.spec.data.map((one) => one[i] ?? "").join(","));
  });
  return rows.join("\n") + "\n";
}

function saveTable(plot) {
  const url = URL.createObjectURL(new Blob([asCsv(plot)], { type: "text/csv" }));
  download(`${plot.spec.id}.csv`, url);
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

function made(spec) {
  const figure = Object.assign(document.createElement("figure"), { id: spec.id });
  const head = Object.assign(document.createElement("div"), { className: "head" });
  const canvas = Object.assign(document.createElement("div"), { className: "canvas" });
  const plot = { spec, figure, canvas, chart: null, zoomed: null };
  head.append(document.createElement("h2"));
  for (const [text, title, act] of [["png", "save as a picture", savePicture], ["csv", "save the values in sight", saveTable]]) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: text, title });
    button.addEventListener("click", () => act(plot));
    head.append(button);
  }
  figure.append(head, canvas);
  document.querySelector(`.plots.${spec.section}`).append(figure);
  canvas.addEventListener("dblclick", () => { plot.zoomed = null; redraw(); });
  new ResizeObserver(() => plot.chart?.setSize({ width: Math.max(100, canvas.clientWidth), height: Math.max(80, canvas.clientHeight - 22) })).observe(canvas);
  plots.set(spec.id, plot);
  return plot;
}

function draw(spec) {
  const plot = plots.get(spec.id) ?? made(spec);
  plot.spec = spec;
  plot.figure.querySelector("h2").textContent = spec.label;
  if (plot.chart !== null && plot.chart.series.length === spec.data.length) {
    plot.chart.setData(spec.data);
  } else {
    plot.chart?.destroy();
    plot.chart = new uPlot(options(plot, plot.canvas), spec.data, plot.canvas);
  }
}

// ---- the whole page

const held = uPlot.paths.stepped({ align: 1 });

function drawPlots({ estimates, motion, marks: newest }) {
  const t = estimates.t;
  marks = newest;
  const edges = [{ label: "−2 s.e.", paths: held, width: 0 }, { label: "+2 s.e.", paths: held, width: 0 }];
  estimates.curves.forEach((one, i) => {
    const refined = one.refinedValue ? [one.refinedValue, one.refinedLow, one.refinedHigh] : [];
    draw({
      id: `parameter${i}`, section: "parameters", label: one.label, data: [t, one.value, one.low, one.high, ...refined], limits: one.limits, marked: true,
      series: [
        { label: refined.length ? "first stage" : "estimate", colour: "blue", width: 2, paths: held }, ...edges,
        ...(refined.length ? [{ label: "second stage", colour: "orange", width: 2, paths: held }, ...edges] : []),
      ],
      bands: refined.length ? [[3, 2], [6, 5]] : [[3, 2]],
    });
  });
  for (const one of plots.keys()) {
    if (one.startsWith("parameter") && Number(one.slice(9)) >= estimates.curves.length) {
      plots.get(one).figure.remove();
      plots.delete(one);
    }
  }
  motion.forEach((one, i) => draw({
    id: `signal${i}`, section: "signals", label: one.label, data: one.modelled ? [one.t, one.x, one.modelled] : [one.t, one.x],
    series: [{ label: "measured", colour: "blue" }, ...(one.modelled ? [{ label: "modelled", colour: "orange" }] : [])],
  }));
  draw({
    id: "residualPlot", section: "signals", label: estimates.residualLabel, data: [t, estimates.residual], limits: estimates.residualLimits, marked: true,
    series: [{ label: "residual", colour: "orange" }],
  });
  draw({
    id: "kappaPlot", section: "signals", label: "excitation, 0 to 1", log: true,
    data: [t, estimates.kappa, t.map(() => NOTHING_BELOW)],
    series: [{ label: "excitation", colour: "green" }, { label: "limit", colour: "red", dash: [6, 4] }],
  });
}

function filled(parent, tag, rows) {
  parent.replaceChildren(...rows.map((texts) => {
    const row = document.createElement(tag === "tr" ? "tr" : "div");
    texts.forEach(([kind, text, style]) => row.append(Object.assign(document.createElement(kind), { textContent: text, className: style ?? "" })));
    if (tag !== "tr") row.className = tag;
    return row;
  }));
}

function drawWords(state) {
  document.title = `pvid log ${state.title}`;
  say("title", state.title);
  say("board", state.board);
  say("link", state.link, state.up ? "good" : "bad");
  document.querySelector("main").hidden = !state.motion.some((one) => one.t.length);
  place("waiting").hidden = !document.querySelector("main").hidden;
  say("received", state.received);
  say("lost", state.lost || "nothing", state.lost ? "bad" : "good");
  say("reason", state.reason || "no estimate yet");
  say("reasonWords", state.reasonWords, "quiet");
  for (const one of ["standingName", "standing"]) place(one).hidden = !state.standing;
  say("standing", state.standing, /^(doubted|withdrawn)/.test(state.standing) ? "bad" : "good");
  for (const one of ["stageName", "stage"]) place(one).hidden = !state.stage;
  say("stage", state.stage);
  say("kappa", state.kappa);
  say("residual", state.residual);
  say("modelled", state.modelled || "none yet", state.modelled ? "" : "quiet");
  place("kappaShare").value = state.kappaShare;
  const large = state.parameters.filter((one) => one.large), small = state.parameters.filter((one) => !one.large);
  filled(place("tiles"), "tile", large.map((one) => [["span", one.name], ["b", one.value], ["span", `${one.error} ${one.unit}`]]));
  filled(place("parameters"), "tr", small.map((one) => [["td", one.name], ["td", one.value], ["td", `${one.error} ${one.unit}`]]));
}

function redraw() {
  if (shown !== null) drawPlots(shown);
}

function rebuild() {
  for (const plot of plots.values()) {
    plot.chart?.destroy();
    plot.chart = null;
  }
  redraw();
}

async function once() {
  if (paused) return PERIOD_MS;
  try {
    const answer = await fetch("state");
    if (!answer.ok) throw new Error(answer.statusText);
    shown = await answer.json();
  } catch {
    place("alarm").textContent = "The recording has ended, or its program is gone: this is the last picture.";
    place("alarm").hidden = false;
    return RETRY_MS;
  }
  place("alarm").hidden = true;
  drawWords(shown);
  redraw();
  return PERIOD_MS;
}

async function forever() {
  for (;;) {
    const began = performance.now();
    const period = await once();
    await new Promise((resume) => setTimeout(resume, Math.max(50, period - (performance.now() - began))));
  }
}

place("pause").addEventListener("click", () => {
  paused = !paused;
  place("pause").textContent = paused ? "go on" : "pause";
  place("pause").setAttribute("aria-pressed", String(paused));
});
place("range").addEventListener("change", () => {
  for (const plot of plots.values()) plot.zoomed = null;
  redraw();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild);
forever();
