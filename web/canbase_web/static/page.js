// On every page: the large STOP, the state of the robot in the header, light or dark, and tables.
document.addEventListener("submit", async event => {
  if (event.target.className !== "stop-form") return;
  event.preventDefault();
  const place = document.getElementById("stop-answer");
  place.textContent = "Stop: no answer yet";
  const patience = new AbortController(), timer = setTimeout(() => patience.abort(), 5000);  // both parts answer sooner
  let said;
  try {
    const answer = await fetch("/stop", {method: "POST", signal: patience.signal});
    said = new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("p").textContent;
  } catch {
    said = "The page does not reach canbase web: press the emergency stop at the robot.";
  }
  clearTimeout(timer);
  place.textContent = said;
});

window.canbasePage = (() => {
  const SILENT_MS = 2000;
  let newest = performance.now();
  const text = (id, value) => { const e = document.getElementById(id); if (e && e.textContent !== value) e.textContent = value; };
  const show = (level, said, waitsForReset) => {
    const state = document.getElementById("state");
    if (!state) return;
    state.dataset.level = level;
    state.title = said;
    text("state", said);
    document.getElementById("to-reset").hidden = !waitsForReset;
  };
  const state = data => { newest = performance.now(); show(data.level, data.text, data.waits_for_reset); };
  setInterval(() => {
    if (performance.now() - newest > SILENT_MS) show("bad", "unknown: no data from canbase web", false);
  }, 500);

  // Rows of a table; where it is narrow, each cell has its column's name beside it. Without rows it says what will be there.
  const row = (cells, names) => {
    const tr = document.createElement("tr");
    cells.forEach((cell, i) => { const td = document.createElement("td"); td.textContent = cell; td.dataset.name = names[i]; tr.append(td); });
    return tr;
  };
  const table = (id, rows) => {
    const whole = document.getElementById(id), now = JSON.stringify(rows);
    if (!whole || whole.dataset.now === now) return;
    whole.dataset.now = now;
    whole.hidden = !rows.length;
    document.getElementById(`${id}-empty`).hidden = rows.length > 0;
    const names = [...whole.querySelectorAll("th")].map(each => each.textContent);
    whole.tBodies[0].replaceChildren(...rows.map(cells => row(cells, names)));
  };

  // Who zooms in, or types with a keyboard on the screen, sees a part of the page: STOP goes where that part is.
  const keepStopInside = () => {
    const view = window.visualViewport, page = document.documentElement;
    const gaps = {left: view.offsetLeft, top: view.offsetTop, right: page.clientWidth - view.offsetLeft - view.width,
                  bottom: page.clientHeight - view.offsetTop - view.height};
    for (const [side, gap] of Object.entries(gaps)) page.style.setProperty(`--unseen-${side}`, `${Math.max(0, gap)}px`);
  };
  for (const kind of ["resize", "scroll"]) window.visualViewport.addEventListener(kind, keepStopInside);

  const NEXT_THEME = {auto: "dark", dark: "light", light: "auto"};
  const theme = () => localStorage.getItem("canbase-theme") in NEXT_THEME ? localStorage.getItem("canbase-theme") : "auto";
  const paint = () => setDark({auto: null, dark: true, light: false}[theme()]);
  addEventListener("DOMContentLoaded", () => { keepStopInside(); paint(); });
  document.addEventListener("click", event => {
    if (!event.target.closest("#theme")) return;
    localStorage.setItem("canbase-theme", NEXT_THEME[theme()]);
    paint();
  });
  return {state, table, text};
})();
