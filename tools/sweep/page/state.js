"use strict";
// What the page shows: rows, which of them, and which is chosen. Parts of the page ask to be told when that changes.

const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const rows = data.rows;
rows.forEach((row, index) => { row.index = index; });
const inputs = [...new Set(rows.map((row) => row.input))];
const codecs = [...new Set(rows.map((row) => row.codec))];

// Of Okabe and Ito: told apart by those who do not see all colours; shapes differ as well.
const colors = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7a6a00", "#56b4e9", "#4d4d4d", "#e69f00", "#882255"];
const shapes = ["circle", "triangle", "rect", "rectRot", "star", "cross", "crossRot", "rectRounded"];
const color = (codec) => colors[codecs.indexOf(codec) % colors.length];
const shape = (codec) => shapes[codecs.indexOf(codec) % shapes.length];

const state = { input: inputs.length > 1 ? inputs[0] : "", codecs: new Set(codecs), conditions: [], frontOnly: false, chosen: null };
const listeners = [];

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Numbers, "inf" as infinity; undefined for anything else.
function number(value) {
  if (typeof value === "number") return value;
  if (value === "inf" || value === "-inf") return value === "inf" ? Infinity : -Infinity;
  return typeof value === "string" && value.trim() !== "" && !Number.isNaN(Number(value)) ? Number(value) : undefined;
}

function shown(value) {
  if (value === undefined || value === null || value === "") return "";
  if (value === true || value === false) return value ? "yes" : "";
  if (value === "inf" || value === Infinity) return "∞";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return value.toLocaleString("en").replaceAll(",", "\u202f");
  return String(Number(value.toPrecision(Math.abs(value) >= 1000 ? 5 : 4)));
}

const higherIsBetter = (column) => data.higher.includes(column.split(".").pop());

// The column that is meant: its own name, or a part that only one has, such as psnr for psnr_db.
function findColumn(name) {
  for (const candidate of [name, `${name}_db`, `param.${name}`]) if (data.columns.includes(candidate)) return candidate;
  const ends = data.columns.filter((column) => column.endsWith(`.${name}`));
  return ends.length === 1 ? ends[0] : undefined;
}

// [[column, test]]; throws a text.
function parseConditions(text) {
  const tests = { ">=": (a, b) => a >= b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, "<": (a, b) => a < b,
    "=": (a, b) => a === b, "==": (a, b) => a === b };
  return text.split(",").filter((part) => part.trim()).map((part) => {
    const found = part.match(/^\s*([^<>=]+?)\s*(>=|<=|==|>|<|=)\s*(\S+)\s*$/);
    if (!found) return [undefined, (row) => words(row).includes(part.trim().toLowerCase())];
    const column = findColumn(found[1]);
    if (!column) throw `There is no column “${found[1]}”.`;
    const limit = number(found[3]);
    if (limit === undefined) throw `“${found[3]}” is no number.`;
    return [column, (row) => { const value = number(row[column]); return value !== undefined && tests[found[2]](value, limit); }];
  });
}

const words = (row) => `${row.input} ${row.codec} ${row.setting} ${row.status} ${row.error}`.toLowerCase();

function visible() {
  return rows.filter((row) => (!state.input || row.input === state.input) && state.codecs.has(row.codec) &&
    (!state.frontOnly || row.pareto) && state.conditions.every(([, test]) => test(row)));
}

function changed() { listeners.forEach((listener) => listener()); }

// Shows a row everywhere.
function choose(row) {
  state.chosen = row;
  changed();
}

// "quality 90, base raw" instead of "--quality 90 --base raw".
const settingOf = (row) => row.setting.replace(/^--/, "").replaceAll(" --", ", ");

const nameOf = (row) => `${state.input || inputs.length === 1 ? "" : row.input + " · "}${row.codec} ${settingOf(row)}`;

function startFilters() {
  const select = $("input");
  if (inputs.length > 1) select.append(element("option", { value: "", textContent: "all inputs" }));
  inputs.forEach((input) => select.append(element("option", { value: input, textContent: input })));
  select.value = state.input || (inputs.length > 1 ? "" : inputs[0]);
  select.addEventListener("change", () => {
    state.input = inputs.length > 1 ? select.value : "";
    state.chosen = null;
    changed();
  });
  codecs.forEach((codec) => {
    const box = element("input", { type: "checkbox", checked: true });
    box.addEventListener("change", () => { state.codecs[box.checked ? "add" : "delete"](codec); changed(); });
    const key = element("span", { className: "key" });
    key.style.background = color(codec);
    $("codecs").append(element("label", { className: "check" }, box, key, codec));
  });
  $("front-only").addEventListener("change", () => { state.frontOnly = $("front-only").checked; changed(); });
  const readConditions = () => {
    let error = "";
    try { state.conditions = parseConditions($("conditions").value); } catch (text) { error = String(text); }
    $("condition-error").textContent = error;
    $("conditions").setAttribute("aria-invalid", error ? "true" : "false");
    if (!error) changed();
  };
  for (const event of ["input", "change"]) $("conditions").addEventListener(event, readConditions);
  const failed = rows.filter((row) => row.status === "failed").length;
  const missing = rows.filter((row) => row.status === "missing").length;
  $("summary").textContent = `${rows.length} settings of ${inputs.length} input${inputs.length > 1 ? "s" : ""}` +
    (failed ? `, ${failed} failed` : "") + (missing ? `, ${missing} not run yet` : "") + `; ${data.version}`;
  $("machine").textContent = `Measured on ${data.machine.cpu}, ${data.machine.cpus} threads, ` +
    `${Math.round(data.machine.memory_bytes / 2 ** 30)} GiB, ${data.machine.system}.`;
}
