"use strict";
// Draws every chart of the page with Plotly, which the page holds compressed. Nothing is loaded from anywhere.
(async () => {
  const packed = document.getElementById("plotly");
  const bytes = Uint8Array.from(atob(packed.textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  packed.remove();
  const charts = JSON.parse(document.getElementById("charts").textContent);
  const font = { family: "Inter, Segoe UI, Helvetica Neue, Arial, sans-serif", size: 12, color: "#1d2327" };
  const grid = "#e3e6e9", labels = new Map();

  // Long rows of zeros would meet the panel beside.
  const format = (panel) => (panel.series.some((s) => s.y.some((v) => v > 0 && v < 1e-4)) ? "~e" : "~g");
  const axis = (label, log, limits, tickformat = "~g") => ({
    title: { text: label, standoff: 6 }, type: log ? "log" : undefined, gridcolor: grid, zeroline: false, linecolor: grid,
    range: limits ? limits.map((v) => (log ? Math.log10(v) : v)) : undefined, automargin: true,
    ...(log ? { dtick: limits && limits[1] < 150 * limits[0] ? "D2" : 1, tickformat, minor: { showgrid: false } } : {}),
  });

  function traces(chart, panel, number, seen) {
    const at = { xaxis: "x" + (number || ""), yaxis: "y" + (number || "") };
    const unit = (label) => (label.includes(" / ") ? " " + label.split(" / ").pop().replace(/[()]/g, "") : "");
    return panel.series.flatMap((s) => {
      const x = chart.x[s.x], first = !seen.has(s.label), out = [];
      seen.add(s.label);
      // Plotly makes class names of identifiers, so that they must be words.
      labels.has(s.label) || labels.set(s.label, labels.size);
      const uid = `c${labels.get(s.label)}p${number}`;
      const common = { ...at, name: s.label, legendgroup: s.label, uid };
      const hover = `%{x}${unit(panel.x)}: %{y}${unit(panel.y)}<extra>${s.label}</extra>`;
      const band = s.low && !s.style.symbol && !s.along;
      if (band) {
        out.push({ ...common, uid: uid + "b", x: x.concat([...x].reverse()), y: s.high.concat([...s.low].reverse()),
          fill: "toself", fillcolor: s.style.colour + "38", line: { width: 0 }, hoverinfo: "skip", showlegend: false, mode: "lines" });
      }
      if (s.kind === "stem") {
        out.push({ ...common, type: "bar", x, y: s.y, marker: { color: s.style.colour }, width: 0.35, showlegend: first, hovertemplate: hover });
        return out;
      }
      const bars = s.low && !band
        ? { [s.along ? "error_x" : "error_y"]: { type: "data", symmetric: false, thickness: 1, width: 0, color: s.style.colour,
            array: s.high.map((v, k) => v - (s.along ? x : s.y)[k]), arrayminus: s.low.map((v, k) => (s.along ? x : s.y)[k] - v) } }
        : {};
      out.push({ ...common, ...bars, x, y: s.y, mode: s.style.symbol ? "markers" : "lines", showlegend: first, hovertemplate: hover, connectgaps: false,
        line: { color: s.style.colour, dash: s.style.dash || "solid", width: s.style.width, shape: s.kind === "step" ? "hv" : "linear" },
        marker: { color: s.style.colour, symbol: s.style.symbol || "circle", size: 6 } });
      return out;
    });
  }

  let paper = false;
  function draw(box, chart, key) {
    const panels = chart.views[key], width = box.clientWidth || 640;
    const columns = Math.max(1, Math.min(chart.columns, Math.floor(width / 230))), rows = Math.ceil(panels.length / columns);
    const seen = new Set(), data = panels.flatMap((panel, number) => traces(chart, panel, number ? number + 1 : 0, seen));
    const entries = [...seen].map((n) => 46 + 6.6 * n.length), widest = Math.max(...entries);
    const legend = 12 + 20 * Math.ceil(entries.length / Math.max(1, Math.floor(width / widest)));
    const height = rows * chart.height * (paper ? 0.74 : 1), gapx = 84 / width, gapy = 62 / height, wide = (1 - gapx * (columns - 1)) / columns;
    const high = (1 - gapy * (rows - 1)) / rows;
    const layout = { font: { ...font, size: paper ? 14 : 12 }, width, height: height + legend + 52, margin: { l: 58, r: 12, t: legend + 18, b: 42 }, paper_bgcolor: "#fff",
      plot_bgcolor: "#fff", hovermode: "closest", uirevision: "kept", annotations: [], shapes: [], bargap: 0.6,
      hoverlabel: { font: { size: 12 }, namelength: -1 },
      legend: { orientation: "h", y: 1 + 26 / height, yanchor: "bottom", x: 0, xanchor: "left", font: { size: paper ? 14 : 12 } } };
    panels.forEach((panel, k) => {
      const n = k ? k + 1 : "", column = k % columns, row = Math.floor(k / columns);
      const left = column * (wide + gapx), top = 1 - row * (high + gapy);
      layout["xaxis" + n] = { ...axis(panel.x, panel.log.includes("x"), panel.x_limits), domain: [left, left + wide], anchor: "y" + n };
      layout["yaxis" + n] = { ...axis(panel.y, panel.log.includes("y"), panel.y_limits, format(panel)), domain: [top - high, top], anchor: "x" + n };
      if (k && panels[0].x === panel.x && !panel.equal) layout["xaxis" + n].matches = "x";
      if (panel.equal) layout["yaxis" + n].scaleanchor = "x" + n;
      layout.annotations.push({ text: panel.title, xref: "paper", yref: "paper", x: left, y: top, xanchor: "left", yanchor: "bottom",
        showarrow: false, font: { size: 12, color: "#545e66" } });
      for (const [on, value, text] of panel.marks) {
        layout.shapes.push({ type: "line", xref: on === "x" ? "x" + n : `x${n} domain`, yref: on === "x" ? `y${n} domain` : "y" + n,
          ...(on === "x" ? { x0: value, x1: value, y0: 0, y1: 1 } : { x0: 0, x1: 1, y0: value, y1: value }), layer: "below",
          line: { color: "#666666", width: 1, dash: "dot" } });
        if (!text) continue;
        const shown = layout["xaxis" + n].type === "log" && on === "x" ? Math.log10(value) : value;
        const shownY = layout["yaxis" + n].type === "log" && on === "y" ? Math.log10(value) : value;
        // Where responses leave room: on the right, and at the top, of logarithmic gains at the bottom.
        const low = panel.log.includes("y");
        layout.annotations.push({ text, showarrow: false, font: { size: 11, color: "#545e66" },
          ...(on === "x" ? { xref: "x" + n, yref: `y${n} domain`, x: shown, y: low ? 0.02 : 0.98, xanchor: "left", yanchor: low ? "bottom" : "top", textangle: -90 }
            : { xref: `x${n} domain`, yref: "y" + n, x: 0.99, y: shownY, xanchor: "right", yanchor: "bottom" }) });
      }
    });
    Plotly.react(box, data, layout, { displayModeBar: false, responsive: false });
  }

  const redraws = [];
  for (const [name, chart] of Object.entries(charts)) {
    const figure = document.querySelector(`[data-chart="${name}"]`);
    if (!figure) continue;
    const box = figure.querySelector(".plot"), chosen = chart.choices.map(([, options]) => options[0]);
    const show = () => { if (chart.views[chosen.join("|")]) draw(box, chart, chosen.join("|")); };
    chart.choices.forEach(([what, options], k) => {
      if (options.length < 2) return;
      const group = document.createElement("div");
      group.className = "choice";
      group.setAttribute("role", "group");
      group.setAttribute("aria-label", what);
      group.append(`${what}: `);
      options.forEach((option) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = option;
        button.setAttribute("aria-pressed", String(option === options[0]));
        button.addEventListener("click", () => {
          chosen[k] = option;
          for (const other of group.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === button));
          show();
        });
        group.append(button);
      });
      figure.insertBefore(group, box);
    });
    redraws.push(show);
    show();
  }
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; redraws.forEach((show) => show()); } });
  // Paper has a width of its own, which the page cannot measure before it prints.
  const boxes = document.querySelectorAll(".plot");
  addEventListener("beforeprint", () => { paper = true; boxes.forEach((box) => { box.style.width = "1085px"; }); redraws.forEach((show) => show()); });
  addEventListener("afterprint", () => { paper = false; boxes.forEach((box) => { box.style.width = ""; }); redraws.forEach((show) => show()); });
  document.documentElement.dataset.drawn = "yes";
})();
