// The page `Now`: the server sends numbers 20 times a second and words 5 times; what the plots keep stays in the browser.
window.canbaseNow = (() => {
  const KEEP_S = 20, series = {};
  const {table, text} = window.canbasePage;
  const plot = (element, name, t, values) => {
    const view = typeof getElement === "function" && getElement(element);
    if (!view || !view.chart) return;
    const kept = series[name] || (series[name] = values.map(() => []));
    values.forEach((value, i) => {
      (kept[i] || (kept[i] = [])).push([t, value]);
      while (kept[i].length && kept[i][0][0] < t - KEEP_S) kept[i].shift();
    });
    view.chart.setOption({xAxis: {min: t - KEEP_S, max: t}, series: kept.map(data => ({data}))}, {lazyUpdate: true});
    if (kept.length) view.$el.dataset.points = kept[0].length;
  };
  const words = data => {
    data.chain.forEach((part, i) => {
      const box = document.getElementById(`part-${i}`);
      if (!box) return;
      box.dataset.level = part.level;
      text(`part-${i}-text`, part.text);
      text(`part-${i}-mark`, {good: "✓", idle: "–", warn: "!", bad: "✕"}[part.level]);
    });
    table("sources", data.sources);
    table("drives", data.drives);
    text("free", data.free);
    text("bus", data.bus);
  };
  const scan = points => {
    const group = document.getElementById("scan");
    if (!group) return;
    group.setAttribute("d", points.map(([x, y]) => `M${(-y).toFixed(2)} ${(-x).toFixed(2)}h0`).join(""));
    document.getElementById("no-scan").hidden = true;
  };
  const update = (plots, data) => {
    if (data.words) words(data.words);
    if (data.scan) scan(data.scan);
    const fast = data.numbers;
    plot(plots.linear, "linear", fast.t, fast.linear);
    plot(plots.angular, "angular", fast.t, fast.angular);
    plot(plots.wheels, "wheels", fast.t, fast.wheels.flat());
  };
  return {update};
})();
