"use strict";
// The original's picture and the compressed form's, on top of each other, with a border between them to move.

function withPictures() { return visible().filter((row) => row.pictures); }

function pairOf(row) {
  const views = Object.keys(row.pictures);
  const view = views.includes($("view").value) ? $("view").value : views[0];
  return [view, row.pictures[view]];
}

function updatePictures() {
  const list = withPictures();
  $("pictures").hidden = list.length === 0;
  if (list.length === 0) return;
  const front = list.filter((candidate) => candidate.pareto).sort((a, b) => a.file_bytes - b.file_bytes);
  const usual = front[front.length >> 1] ?? list[0];  // neither the best, which is no sight, nor the smallest
  const row = state.chosen?.pictures && list.includes(state.chosen) ? state.chosen : usual;
  const views = Object.keys(row.pictures);
  if ([...$("view").options].map((option) => option.value).join() !== views.join())
    $("view").replaceChildren(...views.map((view) => element("option", { value: view, textContent: view })));
  const [view, [before, after]] = pairOf(row);
  $("view").value = view;
  $("view").parentElement.hidden = views.length < 2;
  for (const [id, picture, what] of [["before", before, "original"], ["after", after, "compressed"]]) {
    if ($(id).src !== data.pictures[picture]) $(id).src = data.pictures[picture];
    $(id).alt = `${row.input}, ${what}${id === "after" ? ": " + row.setting : ""}`;
  }
  $("picture-setting").textContent = `${row.input} · ${row.codec} ${settingOf(row)}`;
  const size = number(row.color_percent) === undefined ? ["percent", " % of its size"] : ["color_percent", " % of 24 bits a colour"];
  const facts = [size, ["psnr_db", " dB"], ["grmse", " RMSE of colours"], [`${view}.psnr_db_avg`, " dB in the picture"],
    [`${view}.ms_ssim_avg`, " MS-SSIM"]];
  $("picture-numbers").textContent = facts.filter(([column]) => number(row[column]) !== undefined)
    .map(([column, unit]) => shown(row[column]) + unit).join(", ");
  $("pictures").dataset.row = row.index;
  const at = list.indexOf(row);
  $("previous").disabled = at === 0;
  $("next").disabled = at === list.length - 1;
}

function step(by) {
  const list = withPictures();
  choose(list[list.findIndex((row) => String(row.index) === $("pictures").dataset.row) + by]);
}

function split(percent) {
  const value = Math.round(Math.min(Math.max(percent, 0), 100));
  $("split").value = value;
  $("split-value").textContent = `${value} %`;
  $("stage").style.setProperty("--split", `${value}%`);
}

function startPictures() {
  $("split").addEventListener("input", () => split(Number($("split").value)));
  $("previous").addEventListener("click", () => step(-1));
  $("next").addEventListener("click", () => step(1));
  $("view").addEventListener("change", updatePictures);
  $("difference").addEventListener("change", () => $("stage").classList.toggle("difference", $("difference").checked));
  const drag = (event) => {
    const box = $("stage").getBoundingClientRect();
    split(100 * (event.clientX - box.left) / box.width);
  };
  $("stage").addEventListener("pointerdown", (event) => { event.preventDefault(); $("stage").setPointerCapture(event.pointerId); drag(event); });
  $("stage").addEventListener("pointermove", (event) => { if (event.buttons) drag(event); });
  listeners.push(updatePictures);
  split(50);
  updatePictures();
}

startFilters();
startPictures();
startCharts();
startTable();
