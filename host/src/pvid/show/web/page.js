// Asks for the state (pvid/livestate.py), draws it, and asks again: at most twice a second, and never before the
// last one is drawn.
"use strict";

const PERIOD_MS = 500;
const RETRY_MS = 2000;
const BLUE = "#1f77b4", BAND = "rgba(31, 119, 180, 0.25)", RED = "#d62728", GREEN = "#2ca02c", ORANGE = "#ff7f0e";

const place = (id) => document.getElementById(id);

function say(id, text, kind = "") {
  place(id).textContent = text;
  place(id).className = kind;
}

function draw(id, label, traces, axis = {}, legendTop = 1, below = "time since the first record [s]") {
  const layout = {
    title: { text: label, font: { size: 13 }, x: 0.02, xanchor: "left" },
    margin: { l: 58, r: 12, t: 30, b: 42 },
    xaxis: { title: { text: below, standoff: 6 } },
    yaxis: { exponentformat: "power", ...axis },
    legend: { x: 1, xanchor: "right", y: legendTop, yanchor: "top", bgcolor: "rgba(255, 255, 255, 0.7)", font: { size: 11 } },
    showlegend: traces.some((one) => one.name !== undefined && one.showlegend !== false),
    hovermode: "x",
    uirevision: "kept", // what was zoomed stays zoomed
  };
  return Plotly.react(place(id), traces, layout, { displayModeBar: false, responsive: true });
}

// The id of a plot, which is appended to the section the first time.
function made(id, section) {
  if (place(id) === null) {
    document.querySelector(`.plots${section}`).append(Object.assign(document.createElement("div"), { id }));
  }
  return id;
}

function curve(t, x, color, more = {}) {
  return { x: t, y: x, mode: "lines", line: { color, width: 1.5, simplify: false }, showlegend: false, ...more };
}

function within(limits) {
  return limits === null ? {} : { range: limits };
}

function drawParameter(id, t, one) {
  const edge = { mode: "lines", line: { width: 0, shape: "hv", simplify: false }, hoverinfo: "skip" };
  return draw(id, one.label, [
    { x: t, y: one.low, ...edge, showlegend: false },
    { x: t, y: one.high, ...edge, fill: "tonexty", fillcolor: BAND, name: "±2 s.e." },
    { x: t, y: one.value, mode: "lines", line: { color: BLUE, width: 2, shape: "hv", simplify: false }, name: "estimate" },
  ], within(one.limits));
}

function drawWords(state) {
  document.title = `pvid log ${state.title}`;
  say("title", state.title);
  say("board", state.board);
  say("link", state.link, state.up ? "good" : "bad");
  say("received", state.received);
  say("lost", state.lost || "nothing", state.lost ? "bad" : "good");
  say("reason", state.reason || "no estimate yet");
  say("reasonWords", state.reasonWords, "quiet");
  say("kappa", state.kappa);
  say("residual", state.residual);
  place("kappaShare").value = state.kappaShare;
  place("parameters").replaceChildren(...state.parameters.map((one) => {
    const row = document.createElement("tr");
    for (const text of [one.symbol, one.meaning, one.value, `${one.error} ${one.unit}`]) {
      row.insertCell().textContent = text;
    }
    row.cells[1].className = "quiet";
    return row;
  }));
}

async function drawPlots({ estimates, motion }) {
  const t = estimates.t;
  for (const [i, one] of estimates.curves.entries()) {
    await drawParameter(made(`parameter${i}`, ".parameters"), t, one);
  }
  await draw("residualPlot", estimates.residualLabel, [curve(t, estimates.residual, ORANGE)], within(estimates.residualLimits));
  await draw("kappaPlot", "kappa: are the parameters identifiable?", [
    curve(t, estimates.kappa, GREEN, { name: "kappa", showlegend: true }),
    curve(t, t.map(() => 3e-5), RED, { name: "nothing is published below", showlegend: true, line: { color: RED, dash: "dash" } }),
  ], { type: "log", dtick: 1 }, 0.5);
  for (const [i, one] of motion.entries()) {
    await draw(made(`signal${i}`, ".signals"), one.label, [curve(one.t, one.x, BLUE)]);
  }
}

async function once() {
  let state;
  try {
    const answer = await fetch("state");
    if (!answer.ok) throw new Error(answer.statusText);
    state = await answer.json();
  } catch {
    place("alarm").textContent = "The recording has ended, or its program is gone: this is the last picture.";
    place("alarm").hidden = false;
    return RETRY_MS;
  }
  place("alarm").hidden = true;
  drawWords(state);
  await drawPlots(state);
  return PERIOD_MS;
}

async function forever() {
  for (;;) {
    const began = performance.now();
    const period = await once();
    await new Promise((resume) => setTimeout(resume, Math.max(50, period - (performance.now() - began))));
  }
}

forever();
