"use strict";
// Charts of any column over any other, with the Pareto front. Points are reached by mouse, touch and arrow keys.

const numeric = data.columns.filter((column) => rows.some((row) => number(row[column]) !== undefined));
const charts = [];

function first(...names) { return names.map(findColumn).find((name) => name && numeric.includes(name)) ?? numeric[0]; }

// No other of the points is at least as good in both and better in one.
function frontOf(points, lessX, lessY) {
  const sorted = [...points].sort((a, b) => (lessX ? a.x - b.x : b.x - a.x) || (lessY ? a.y - b.y : b.y - a.y));
  let best;
  return sorted.filter((point) => {
    if (best !== undefined && (lessY ? point.y >= best : point.y <= best)) return false;
    best = point.y;
    return true;
  });
}

class Panel {
  constructor(place, plot, number_) {
    this.plot = plot;
    this.id = `chart-${number_}`;
    this.x = this.select("x", plot.x);
    this.y = this.select("y", plot.y);
    this.log = ["x", "y"].map((axis) => {
      const box = element("input", { type: "checkbox", checked: plot.log.includes(axis) });
      box.addEventListener("change", () => this.update());
      box.setAttribute("aria-label", axis === "x" ? "logarithmic across" : "logarithmic up");
      return box;
    });
    this.canvas = element("canvas", { tabIndex: 0 });
    this.canvas.setAttribute("role", "img");
    this.told = element("p", { className: "told" });
    this.told.setAttribute("role", "status");
    const axis = (name, select, log) => element("div", {}, element("label", {}, name, select), element("label", { className: "check" }, log, "log"));
    const axes = element("div", { className: "axes" }, axis("across", this.x, this.log[0]), axis("up", this.y, this.log[1]));
    const title = element("h2", { textContent: plot.title, id: `${this.id}-title` });
    place.append(element("div", { className: "chart", id: this.id }, title, axes, element("div", { className: "plot" }, this.canvas), this.told));
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    this.chart = new Chart(this.canvas, { type: "scatter", data: { datasets: [] }, options: this.options() });
    listeners.push(() => this.update());
    this.update();
  }

  select(axis, chosen) {
    const made = element("select");
    numeric.forEach((column) => made.append(element("option", { value: column, textContent: data.names[column] ?? column })));
    made.value = chosen;
    made.setAttribute("aria-label", axis === "x" ? "across" : "up");
    made.addEventListener("change", () => { this.chosenAxes = true; this.update(); });
    return made;
  }

  options() {
    return {
      animation: false, responsive: true, maintainAspectRatio: false, normalized: true,
      interaction: { mode: "nearest", intersect: true },
      onClick: (_, hits) => { const row = hits.map((hit) => this.rowOf(hit)).find(Boolean); if (row) choose(row); },
      plugins: {
        legend: { labels: { usePointStyle: true, boxWidth: 7, boxHeight: 7, filter: (item) => !item.text.startsWith("\0") }, onClick: () => {} },
        tooltip: { callbacks: { title: () => "", label: (item) => this.describe(item.raw.row) }, filter: (item) => Boolean(item.raw.row) },
      },
    };
  }

  rowOf(hit) { return this.chart.data.datasets[hit.datasetIndex].data[hit.index].row; }

  describe(row) {
    return row ? [nameOf(row), ...[this.x.value, this.y.value].map((c) => `${data.names[c] ?? c}: ${shown(row[c])}`)] : "";
  }

  // Points; infinity is drawn a little above the greatest number.
  points() {
    const [x, y] = [this.x.value, this.y.value];
    const points = visible().filter((row) => !this.plot.inputs || (this.plot.inputs.includes(row.input) && this.plot.codecs.includes(row.codec))).map((row) => ({ x: number(row[x]), y: number(row[y]), row }))
      .filter((point) => point.x !== undefined && point.y !== undefined && (!this.log[0].checked || point.x > 0) && (!this.log[1].checked || point.y > 0));
    this.tops = {};
    for (const axis of ["x", "y"]) {
      const finite = points.map((point) => point[axis]).filter(Number.isFinite);
      if (finite.length === points.length) continue;
      const [least, most] = finite.length ? [Math.min(...finite), Math.max(...finite)] : [0, 100];
      this.tops[axis] = most + 0.12 * Math.max(most - least, Math.abs(most) * 0.1, 1e-9);
      points.forEach((point) => { if (point[axis] === Infinity) point[axis] = this.tops[axis]; });
    }
    return points.filter((point) => Number.isFinite(point.x) && Number.isFinite(point.y));
  }

  // What is nearly 0 is shown from 0 on; never less, of what has no sign.
  fromZero(axis) {
    const values = this.list.map((point) => point[axis]);
    const least = Math.min(...values);
    return values.length > 0 && least >= 0 && least < 0.2 * Math.max(...values);
  }

  scale(axis, column, log) {
    const top = this.tops[axis];
    return {
      type: log ? "logarithmic" : "linear", title: { display: true, text: data.names[column] ?? column, font: { size: 13 } },
      afterBuildTicks: (scale) => {
        if (top === undefined) return;
        scale.ticks = scale.ticks.filter((tick) => tick.value < top - 0.1 * (scale.max - scale.min)).concat({ value: top });
      },
      grace: "4%", min: !log && this.fromZero(axis) ? 0 : undefined,
      ticks: { callback: function (value, index, ticks) {
        if (top !== undefined && Math.abs(value - top) < 1e-9 * Math.abs(top)) return "∞";
        return log ? Chart.Ticks.formatters.logarithmic.call(this, value, index, ticks) : shown(Number(value.toPrecision(6)));
      }, maxRotation: 0, autoSkipPadding: 12 },
    };
  }

  // Until an axis is chosen: the first of those wanted that what is shown has values of.
  usualAxes() {
    if (this.chosenAxes || !this.plot.wanted) return;
    const shownRows = visible();
    const found = this.plot.wanted.find((column) => shownRows.some((row) => number(row[column]) !== undefined));
    if (found) this.x.value = found;
  }

  update() {
    this.usualAxes();
    const points = this.list = this.points().sort((a, b) => a.x - b.x || a.y - b.y);
    const withFront = (this.plot.line ?? "front") === "front";
    const [x, y] = [this.x.value, this.y.value];
    const datasets = [];
    const groups = new Map();
    points.forEach((point) => {
      const name = state.input || inputs.length === 1 ? point.row.codec : `${point.row.input} · ${point.row.codec}`;
      groups.set(name, [...(groups.get(name) ?? []), point]);
    });
    const single = new Set(points.map((point) => point.row.input)).size <= 1;
    const front = new Set(single && withFront ? frontOf(points, !higherIsBetter(x), !higherIsBetter(y)) : []);
    if (front.size > 1)
      datasets.push({ label: "Pareto front", data: [...front].sort((a, b) => a.x - b.x).map(({ x: a, y: b }) => ({ x: a, y: b })), showLine: true,
        pointRadius: 0, pointHitRadius: 0, borderColor: "#57606a", borderDash: [6, 4], borderWidth: 2, pointStyle: "line", order: 9 });
    [...groups].sort(([, a], [, b]) => codecs.indexOf(a[0].row.codec) - codecs.indexOf(b[0].row.codec)).forEach(([name, group]) => {
      const codec = group[0].row.codec;
      const isFront = group.map((point) => front.has(point));
      const isChosen = group.map((point) => point.row === state.chosen);
      datasets.push({ label: name, data: group, pointStyle: shape(codec), borderColor: group.map((_, i) => (isChosen[i] ? "#000" : color(codec))),
        backgroundColor: group.map((_, i) => (isFront[i] || isChosen[i] ? color(codec) : color(codec) + "55")),
        borderWidth: isChosen.map((chosen) => (chosen ? 3 : 1.5)),
        pointRadius: group.map((_, i) => (isChosen[i] ? 10 : isFront[i] ? 7 : 4.5)), pointHoverRadius: 9, pointHitRadius: 10 });
    });
    if (this.plot.line === "all")
      datasets.forEach((dataset) => Object.assign(dataset, { showLine: true, borderWidth: 1.5, borderColor: dataset.borderColor.find((line) => line !== "#000") ?? "#000" }));
    const base = this.plot.baseline ? visible().map((row) => number(row[this.plot.baseline])).filter(Number.isFinite).sort((a, b) => a - b) : [];
    if (base.length && points.length && y === this.plot.y)
      datasets.push({ label: data.names[this.plot.baseline] ?? this.plot.baseline, showLine: true, pointRadius: 0, pointHitRadius: 0, pointStyle: "line",
        borderColor: "#2a7a2a", data: [Math.min, Math.max].map((end) => ({ x: end(...points.map((point) => point.x)), y: base[base.length >> 1] })) });
    this.chart.data.datasets = datasets;
    this.chart.options.scales = { x: this.scale("x", x, this.log[0].checked), y: this.scale("y", y, this.log[1].checked) };
    this.chart.update();
    this.canvas.setAttribute("aria-label", `${this.plot.title}: ${data.names[y] ?? y} over ${data.names[x] ?? x}, ${points.length} settings. ` +
      "Arrow keys go from point to point, Enter shows the picture.");
    const chosen = this.list.find((point) => point.row === state.chosen);
    const best = [...front].map((point) => point.row);
    this.told.textContent = chosen ? this.describe(chosen.row).join(", ")
      : points.length === 0 ? "No setting has both." : `${points.length} settings` + (!withFront ? "." : single ? `, ${best.length} on the front.` : ". Choose one input to see its front.");
  }

  key(event) {
    const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (event.key === "Enter" && state.chosen && !$("pictures").hidden) {
      event.preventDefault();
      $("split").focus();
      return;
    }
    if (!step || this.list.length === 0) return;
    event.preventDefault();
    const at = this.list.findIndex((point) => point.row === state.chosen);
    const next = at < 0 ? (step > 0 ? 0 : this.list.length - 1) : Math.min(Math.max(at + step, 0), this.list.length - 1);
    choose(this.list[next].row);
  }
}

function startCharts() {
  if (typeof Chart === "undefined") {
    $("charts").append(element("p", { textContent: "No charts: Chart.js was not found when this page was written (Debian: libjs-chart.js)." }));
    return;
  }
  Chart.defaults.font.size = 12;
  Chart.defaults.color = "#1b1f24";
  const times = [...data.renders.map((name) => `${name}.ms_avg`), "decode_seconds", "encode_seconds"].filter((name) => numeric.includes(name));
  const plots = [
    { title: "Size and error", x: first(data.axes[0], "percent"), y: first(data.axes[1], "rmse"), log: "" },
    { title: "Time and error", x: times[0] ?? numeric[0], wanted: times, y: first(data.axes[1], "rmse"), log: "" },
  ];
  // Those that the spec asks for, but for what is there already.
  const usual = plots.map((plot) => `${plot.x} ${plot.y}`);
  data.plots.filter((plot) => numeric.includes(plot.x) && numeric.includes(plot.y)).forEach((plot) => {
    const at = usual.indexOf(`${plot.x} ${plot.y}`);
    if (at < 0) plots.push(plot);
    else plots[at] = { ...plots[at], ...plot };
  });
  plots.forEach((plot, index) => charts.push(new Panel($("charts"), plot, index)));
}
