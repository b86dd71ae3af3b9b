document.addEventListener("DOMContentLoaded", () => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  // Labels are escaped for the library, which reads tags; a menu shows text as it is.
  const plain = (text) => new DOMParser().parseFromString(text, "text/html").body.textContent;
  const draw = (figure) => {
    const ink = dark.matches ? "#d7dce2" : "#1b1f24";
    const grid = dark.matches ? "#3a414a" : "#e3e6ea";
    const axis = (title, type) => ({
      title: { text: title, font: { size: 13 } }, type, dtick: type === "log" ? "D2" : null, gridcolor: grid, zeroline: false, automargin: true,
    });
    const view = figure.view;
    const shown = figure.traces.filter((trace) => !trace.view || trace.view === view);
    const traces = shown.map((trace) => ({
      name: trace.name, x: trace.x, y: trace.y, mode: trace.mode, type: "scatter",
      text: trace.notes, hovertemplate: "%{x:.4g}, %{y:.4g} %{text}<extra>%{fullData.name}</extra>",
      line: { color: trace.color || ink, width: 1.6 },
      marker: { color: trace.color || ink, size: 6, opacity: 0.75 },
    }));
    const plot = document.getElementById("figure-" + figure.name);
    // A narrow legend has a row a trace.
    const rows = plot.clientWidth < 500 ? traces.length : 1;
    const layout = {
      height: 360 + 20 * rows, margin: { t: 10, r: 10, b: 45, l: 55 }, hovermode: "closest",
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: ink, size: 13 }, legend: { orientation: "h", yref: "container", y: 0, yanchor: "bottom" },
      hoverlabel: { bgcolor: dark.matches ? "#22272e" : "#ffffff", font: { color: ink } },
      xaxis: axis(figure.x, "linear"),
      yaxis: axis(view || figure.y, figure.logarithmic ? "log" : "linear"),
    };
    Plotly.react(plot, traces, layout, { responsive: true, displaylogo: false });
  };
  for (const figure of figures) {
    figure.view = figure.views[0];
    if (figure.views.length > 1) {
      const label = document.createElement("label");
      const menu = document.createElement("select");
      label.className = "pick";
      label.append("Show ", menu);
      figure.views.forEach((view) => menu.add(new Option(plain(view), view)));
      menu.addEventListener("change", () => { figure.view = menu.value; draw(figure); });
      document.getElementById("figure-" + figure.name).before(label);
    }
    draw(figure);
  }
  dark.addEventListener("change", () => figures.forEach(draw));
});
