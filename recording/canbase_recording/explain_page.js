const dark = matchMedia("(prefers-color-scheme: dark)");
function paint(plot) {
  const css = getComputedStyle(document.documentElement), line = css.getPropertyValue("--line").trim();
  const change = {"font.color": css.getPropertyValue("--text").trim()};
  for (const key of Object.keys(plot.layout))
    if (/^[xy]axis/.test(key)) { change[key + ".gridcolor"] = line; change[key + ".zerolinecolor"] = line; }
  Plotly.relayout(plot, change);
}
for (const script of document.querySelectorAll("script.figure")) {
  const figure = JSON.parse(script.textContent), plot = document.getElementById(script.dataset.plot);
  Plotly.newPlot(plot, figure.data, figure.layout, {responsive: true, displaylogo: false}).then(() => paint(plot));
  dark.addEventListener("change", () => paint(plot));
}
const MOST = 1500;
for (const script of document.querySelectorAll("script.rows")) {
  const rows = JSON.parse(script.textContent), box = document.getElementById(script.dataset.table);
  const body = box.querySelector("tbody"), text = box.querySelector("input"), kind = box.querySelector("select");
  const count = box.querySelector("output");
  const draw = () => {
    const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
    const shown = rows.filter(row => (!kind.value || row[3] === kind.value)
      && words.every(word => row.join(" ").toLowerCase().includes(word)));
    body.replaceChildren(...shown.slice(0, MOST).map(row => {
      const line = document.createElement("tr");
      for (const value of row) line.appendChild(document.createElement("td")).textContent = value;
      return line;
    }));
    count.textContent = shown.length + " frames" + (shown.length > MOST ? ", the first " + MOST + " shown" : "");
  };
  text.addEventListener("input", draw); kind.addEventListener("change", draw); draw();
}
