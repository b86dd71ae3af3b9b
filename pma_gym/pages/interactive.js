document.addEventListener("DOMContentLoaded", () => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const drawAll = () => {
    const ink = dark.matches ? "#d7dce2" : "#1b1f24";
    const grid = dark.matches ? "#3a414a" : "#e3e6ea";
    const axis = (title, type) => ({
      title: { text: title }, type, gridcolor: grid, zeroline: false, automargin: true,
    });
    for (const figure of figures) {
      const traces = figure.traces.map((trace) => ({
        name: trace.name, x: trace.x, y: trace.y, mode: trace.mode, type: "scatter",
        text: trace.notes, hovertemplate: "%{x:.4g}, %{y:.4g} %{text}<extra>%{fullData.name}</extra>",
        line: { color: trace.color || ink, width: 1.6 },
        marker: { color: trace.color || ink, size: 6, opacity: 0.75 },
      }));
      const layout = {
        height: 380, margin: { t: 10, r: 10, b: 45, l: 55 }, hovermode: "closest",
        paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        font: { color: ink, size: 13 }, legend: { orientation: "h", y: -0.2 },
        hoverlabel: { bgcolor: dark.matches ? "#22272e" : "#ffffff", font: { color: ink } },
        xaxis: axis(figure.x, "linear"),
        yaxis: axis(figure.y, figure.logarithmic ? "log" : "linear"),
      };
      Plotly.react("figure-" + figure.name, traces, layout, { responsive: true, displaylogo: false });
    }
  };
  drawAll();
  dark.addEventListener("change", drawAll);
});
