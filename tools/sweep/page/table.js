"use strict";
// The table: sorted by any column, with the columns that are asked for.

const shownColumns = new Set(data.columns.filter((column) => data.usual.includes(column)));
const order = { column: "file_bytes", down: false };

function compareRows(a, b) {
  const [x, y] = [a, b].map((row) => (order.column === "" ? nameOf(row) : row[order.column]));
  const [m, n] = [number(x), number(y)];
  if (m === undefined && n === undefined) return String(x ?? "").localeCompare(String(y ?? "")) || a.index - b.index;
  if (m === undefined || n === undefined) return (m === undefined ? 1 : -1) * (order.down ? -1 : 1);
  return m === n ? a.index - b.index : m - n;
}

const isWords = (column) => column === "" || !rows.some((row) => number(row[column]) !== undefined);

function heading(column) {
  const active = order.column === column;
  const button = element("button", { type: "button" }, (column === "" ? "setting" : data.names[column] ?? column) +
    (active ? (order.down ? " ▼" : " ▲") : ""));
  button.addEventListener("click", () => {
    order.down = order.column === column ? !order.down : column !== "" && higherIsBetter(column);
    order.column = column;
    updateTable();
    [...$("head").children].find((cell) => cell.dataset.column === column).querySelector("button").focus();
  });
  const cell = element("th", { scope: "col", className: isWords(column) ? "words" : "" }, button);
  cell.dataset.column = column;
  cell.setAttribute("aria-sort", active ? (order.down ? "descending" : "ascending") : "none");
  return cell;
}

function line(row, columns) {
  const button = element("button", { type: "button" }, nameOf(row));
  button.addEventListener("click", () => { choose(row); if (row.pictures && !$("pictures").hidden) $("pictures").scrollIntoView({ block: "nearest" }); });
  if (row.pareto) button.append(element("span", { className: "front", textContent: " ◆", title: "Pareto front" }));
  const made = element("tr", { className: row.status }, element("th", { scope: "row" }, button));
  if (row === state.chosen) {
    made.classList.add("chosen");
    made.setAttribute("aria-current", "true");
  }
  columns.forEach((column) => made.append(element("td", { textContent: shown(row[column]),
    className: (isWords(column) ? "words" : "") + (column === "error" ? " long" : "") })));
  return made;
}

function updateTable() {
  const list = visible().sort((a, b) => compareRows(a, b) * (order.down ? -1 : 1));
  // Those that only other inputs have values of are left out.
  const columns = data.columns.filter((column) => shownColumns.has(column) && list.some((row) => shown(row[column]) !== ""));
  const focused = document.activeElement?.closest("tr");
  const again = focused && $("body").contains(focused) ? focused.dataset.row : undefined;
  $("head").replaceChildren(heading(""), ...columns.map(heading));
  $("body").replaceChildren(...list.map((row) => { const made = line(row, columns); made.dataset.row = row.index; return made; }));
  if (again !== undefined) $("body").querySelector(`tr[data-row="${again}"] button`)?.focus();
  const failed = list.filter((row) => row.status === "failed").length;
  $("count").textContent = `${list.length} of ${rows.length} settings` + (failed ? `, ${failed} failed` : "");
}

function startTable() {
  if (!data.columns.includes("file_bytes")) order.column = "";
  data.columns.filter((column) => !["setting", "pareto"].includes(column)).forEach((column) => {
    const box = element("input", { type: "checkbox", checked: shownColumns.has(column) });
    box.addEventListener("change", () => { shownColumns[box.checked ? "add" : "delete"](column); updateTable(); });
    $("columns").append(element("label", { className: "check" }, box, data.names[column] ?? column));
  });
  listeners.push(updateTable);
  updateTable();
}
