const dark = matchMedia("(prefers-color-scheme: dark)"), config = {responsive: true, displaylogo: false};
const read = name => { const found = document.getElementById(name); return found && JSON.parse(found.textContent); };
const overviews = read("overviews"), curves = read("curves");
function dressed(layout) {
  const css = getComputedStyle(document.documentElement), line = css.getPropertyValue("--line").trim();
  const whole = {paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", ...structuredClone(layout),
    font: {size: 12, color: css.getPropertyValue("--text").trim()}};
  for (const key of Object.keys(whole)) if (/^[xy]axis/.test(key)) Object.assign(whole[key], {gridcolor: line, zerolinecolor: line});
  return whole;
}
const metric = () => document.querySelector("input[name=metric]:checked").value;
function overview() {
  const figure = overviews[metric()];
  Plotly.react("overview", structuredClone(figure.data), dressed(figure.layout), config);
}
function curve() {
  const which = document.getElementById("which").value, found = curves[which], unit = metric() === "time_s" ? "s" : "m";
  const steps = found[metric()];
  Plotly.react("curve", [{type: "scatter", mode: "lines+markers", x: steps.map(s => s[0]), y: steps.map(s => 100 * s[1]),
    line: {shape: "hv", color: "#3b82c4"}, marker: {size: 4}, hovertemplate: "%{y:.1f} % within %{x:.3f} " + unit + "<extra></extra>"}],
    dressed({xaxis: {ticksuffix: " " + unit, rangemode: "tozero"}, yaxis: {ticksuffix: " %", range: [0, 102]},
      title: {text: which + ", " + found.runs + " runs", font: {size: 13}}, margin: {l: 55, r: 20, t: 40, b: 40}}), config);
}
function draw() { overview(); curve(); }
if (overviews) {
  for (const input of document.querySelectorAll("input[name=metric]")) input.addEventListener("change", draw);
  document.getElementById("which").addEventListener("change", curve);
  dark.addEventListener("change", draw);
  draw();
}
