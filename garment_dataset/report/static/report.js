"use strict";
// What moves on the pages of a report. Every page works without it, but for curves, loop and the view in space.
(() => {
  const data = (id) => {
    const element = document.getElementById(id);
    return element ? JSON.parse(element.textContent) : null;
  };
  const styles = () => getComputedStyle(document.documentElement);
  const color = (name) => styles().getPropertyValue(name).trim();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const isPhone = () => innerWidth < 640;

  // --- filters that work while typing
  const filterRows = (form) => {
    const words = form.querySelector("[data-words]").value.toLowerCase().split(/\s+/).filter(Boolean);
    const wanted = [...form.querySelectorAll("[data-key]")].filter((select) => select.value);
    const rows = [...document.querySelectorAll(`#${form.dataset.filters} tbody tr`)];
    let shown = 0;
    for (const row of rows) {
      const text = row.dataset.text.toLowerCase();
      const fits = words.every((word) => text.includes(word))
        && wanted.every((select) => row.dataset[select.dataset.key].split(" ").includes(select.value));
      row.hidden = !fits;
      shown += fits;
    }
    const count = form.querySelector("[data-count]");
    count.textContent = `${shown} of ${rows.length} ${count.dataset.count}`;
  };
  for (const form of document.querySelectorAll("[data-filters]")) {
    form.addEventListener("input", () => filterRows(form));
    form.addEventListener("reset", () => setTimeout(() => filterRows(form)));
    form.addEventListener("submit", (event) => event.preventDefault());
    filterRows(form);
  }

  // --- what all plots share
  const looks = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", autosize: true,
    font: { color: color("--text"), family: "system-ui, sans-serif", size: 13 },
    hoverlabel: { font: { family: "system-ui, sans-serif" } },
    ...more,
  });
  const config = { displaylogo: false, responsive: true, showTips: false, displayModeBar: false };

  // --- curves over time
  const curves = data("curves-data");
  if (curves && window.Plotly) {
    const place = document.getElementById("curves-plot");
    const chosen = document.getElementById("quantity");
    const bands = document.getElementById("bands");
    const lineColor = (trace) => (trace.colors ? trace.colors[dark.matches ? 1 : 0] : color("--text"));
    const axis = (title) => ({ title: { text: title }, gridcolor: color("--grid"), zerolinecolor: color("--dim"), linecolor: color("--line"), automargin: true });
    const band = (trace, times, shade) => {
      // each unbroken piece is a polygon of its own: a band is not drawn across what is missing
      const x = [], y = [];
      let piece = [];
      const close = () => {
        if (piece.length > 1) {
          for (const [t, value, std] of piece) { x.push(t); y.push(value + 2 * std); }
          for (const [t, value, std] of piece.reverse()) { x.push(t); y.push(value - 2 * std); }
          x.push(null); y.push(null);
        }
        piece = [];
      };
      trace.value.forEach((value, index) => {
        const std = trace.std[index];
        if (value === null || std === null || times[index] === null) close();
        else piece.push([times[index], value, std]);
      });
      close();
      return { x, y, type: "scatter", mode: "none", fill: "toself", fillcolor: shade, opacity: 0.22, hoverinfo: "skip", showlegend: false, legendgroup: trace.name };
    };
    const draw = () => {
      const quantity = curves.quantities[Number(chosen.value)];
      const traces = [];
      for (const trace of quantity.traces) {
        const times = curves.times[trace.time];
        const shade = lineColor(trace);
        if (bands.checked && trace.std) traces.push(band(trace, times, shade));
        traces.push({
          x: times, y: trace.value, customdata: trace.std ?? undefined, name: trace.name, legendgroup: trace.name,
          type: "scatter", mode: "lines+markers", connectgaps: false,
          // a value between gaps is no line: it is a dot
          marker: { color: shade, opacity: 1, line: { width: 0 }, size: trace.value.map((_, at) => ((trace.value[at - 1] ?? null) === null && (trace.value[at + 1] ?? null) === null ? 7 : 0)) },
          line: { color: shade, width: 1.8, dash: trace.name === "gripper" ? "dash" : "solid" },
          hovertemplate: `%{y:.4~g} ${quantity.unit}${trace.std ? ` ± %{customdata:.2~g} ${quantity.unit}` : ""}<br>%{x:.3f} s<extra>${trace.name}</extra>`,
        });
      }
      const unit = quantity.unit ? ` [${quantity.unit}]` : "";
      Plotly.react(place, traces, looks({
        margin: { l: 8, r: 8, t: 8, b: 8 }, hovermode: "closest", hoverdistance: 60, dragmode: isPhone() ? false : "zoom",
        showlegend: quantity.traces.length > 1, legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
        xaxis: axis(isPhone() ? "time [s]" : curves.time),
        yaxis: { ...axis(isPhone() ? unit.trim() : quantity.label + unit), range: quantity.limits ?? undefined },
      }), config);
      document.getElementById("quantity-described").textContent = `${quantity.description} (${quantity.column})`;
    };
    chosen.addEventListener("change", draw);
    bands.addEventListener("change", draw);
    dark.addEventListener("change", draw);
    draw();
  }

  // --- steps through frames: a slider, and buttons on both sides
  const stepper = (place, count, show) => {
    const slider = place.querySelector("[data-frame]");
    const go = (frame) => {
      const wrapped = ((frame % count) + count) % count;
      slider.value = wrapped;
      show(wrapped);
    };
    slider.addEventListener("input", () => go(Number(slider.value)));
    for (const button of place.querySelectorAll("[data-step]")) {
      button.addEventListener("click", () => go(Number(slider.value) + Number(button.dataset.step)));
    }
    return { go, at: () => Number(slider.value) };
  };

  // --- the loop of depth and colour
  const loop = data("loop-data");
  const player = document.getElementById("player");
  if (loop && player) {
    const streams = Object.entries(loop).filter(([, frames]) => frames.length);
    const [, longest] = streams.reduce((best, each) => (each[1].length > best[1].length ? each : best));
    const slider = player.querySelector("[data-frame]");
    const frames = stepper(player, longest.length, (index) => {
      const time = longest[index].time_s;
      for (const [stream, own] of streams) {
        const frame = own.reduce((best, each) => (Math.abs(each.time_s - time) < Math.abs(best.time_s - time) ? each : best));
        player.querySelector(`img[data-stream="${stream}"]`).src = frame.src;
        player.querySelector(`[data-caption="${stream}"]`).textContent = `frame ${frame.frame}, ${frame.time_s.toFixed(2)} s`;
      }
      slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    });
    const seconds = longest.length > 1 ? (longest.at(-1).time_s - longest[0].time_s) / (longest.length - 1) : 0.2;
    const button = player.querySelector("[data-play]");
    let timer = null;
    const play = (is) => {
      clearInterval(timer);
      timer = is ? setInterval(() => frames.go(frames.at() + 1), Math.min(1000, Math.max(40, 1000 * seconds))) : null;
      button.textContent = is ? "Pause" : "Play";
      button.setAttribute("aria-pressed", String(is));
    };
    button.addEventListener("click", () => play(timer === null));
    for (const each of player.querySelectorAll("[data-step], [data-frame]")) each.addEventListener("pointerdown", () => play(false));
    frames.go(0);
    // it begins by itself where people have not asked for less motion, and rests while it is not seen
    const still = matchMedia("(prefers-reduced-motion: reduce)");
    let begun = false;
    new IntersectionObserver(([entry]) => {
      if (!entry.isIntersecting) { if (timer !== null) { play(false); begun = false; } }
      else if (!begun && !still.matches) { begun = true; play(true); }
    }).observe(player);
    still.addEventListener("change", () => { if (still.matches) play(false); });
  }

  // --- a frame in space
  const clouds = data("cloud-data");
  if (clouds && window.Plotly) {
    const place = document.getElementById("cloud-plot");
    const controls = document.getElementById("cloud-controls");
    const said = document.getElementById("cloud-said");
    const pointColors = ["#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442"];
    const decode = (text) => {
      const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
      const view = new DataView(bytes.buffer);
      const found = [[], [], []];
      for (let at = 0; at + 1 < bytes.length; at += 2) found[(at / 2) % 3].push(view.getInt16(at, true) / 1000);
      return found;
    };
    const decoded = clouds.frames.map((frame) => decode(frame.cloud));
    // one box for all frames: what moves, moves
    const range = (axis) => {
      let low = Infinity, high = -Infinity;
      for (const each of decoded) for (const value of each[axis]) { low = Math.min(low, value); high = Math.max(high, value); }
      return low <= high ? [low - 0.02, high + 0.02] : [-0.5, 0.5];
    };
    const ranges = [range(0), range(1), range(2)];
    // as one stands: forward is into the picture, up is up; the camera's y points down
    let eye = { x: -0.9, y: -1.4, z: 0.4 };
    const spans = ranges.map(([low, high]) => high - low);
    const largest = Math.max(...spans);
    const ratio = { x: spans[0] / largest, y: spans[2] / largest, z: spans[1] / largest };
    const spread = (rows) => ({ x: rows.map((row) => row?.[0] ?? null), y: rows.map((row) => row?.[2] ?? null), z: rows.map((row) => row?.[1] ?? null) });
    const hover = (name) => `${name}<br>x %{x:.3f} m<br>y %{z:.3f} m<br>z %{y:.3f} m<extra></extra>`;
    const traces = (index) => {
      const frame = clouds.frames[index];
      const [x, y, z] = decoded[index];
      const points = spread(frame.points);
      const gripper = spread(frame.gripper ? [frame.gripper] : []);
      return [
        { type: "scatter3d", mode: "markers", name: "cloud", x, y: z, z: y, hovertemplate: hover("cloud"), marker: { size: 1.8, color: z, colorscale: [[0, color("--near")], [1, color("--far")]], cmin: Math.min(...z), cmax: Math.max(...z), opacity: 0.7 } },
        { type: "scatter3d", mode: "lines", name: "chain", ...spread(frame.chain), hovertemplate: hover("chain"), line: { width: 6, color: color("--text") } },
        { type: "scatter3d", mode: "markers", name: "points", ...points, text: frame.points.map((_, number) => `point ${number + 1}`), hovertemplate: hover("%{text}"), marker: { size: 7, color: frame.points.map((_, number) => pointColors[number % pointColors.length]), line: { color: "#fff", width: 1 } } },
        { type: "scatter3d", mode: "markers", name: "gripper", ...gripper, hovertemplate: hover("gripper"), marker: { size: 6, symbol: "x", color: "#d62728" } },
      ];
    };
    const show = (index) => {
      const axis = (title, span) => ({ title: { text: title }, range: span, gridcolor: color("--grid"), zeroline: false, showbackground: false, color: color("--text"), nticks: 5 });
      const frame = clouds.frames[index];
      Plotly.react(place, traces(index), looks({
        margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "turned", legend: { orientation: "h", y: 1, yanchor: "top", itemsizing: "constant" },
        scene: {
          aspectmode: "manual", aspectratio: ratio, dragmode: "turntable", camera: { eye, up: { x: 0, y: 0, z: 1 } }, uirevision: "turned",
          xaxis: axis("x right [m]", ranges[0]), yaxis: axis("z forward [m]", ranges[2]), zaxis: axis("y down [m]", [ranges[1][1], ranges[1][0]]),
        },
      }), config);
      said.textContent = `frame ${frame.frame}, ${frame.time_s.toFixed(2)} s: ${decoded[index][0].length} pixels of the cloud, ${frame.points.length ? `${frame.points.filter(Boolean).length} of ${frame.points.length} points` : "no points were asked for"}`;
    };
    const frames = stepper(controls, clouds.frames.length, show);
    for (const button of controls.querySelectorAll("[data-turn]")) {
      button.addEventListener("click", () => {
        const seen = place._fullLayout.scene.camera.eye;
        const angle = Number(button.dataset.turn) * Math.PI / 12;
        eye = { x: seen.x * Math.cos(angle) - seen.y * Math.sin(angle), y: seen.x * Math.sin(angle) + seen.y * Math.cos(angle), z: seen.z };
        Plotly.relayout(place, { "scene.camera.eye": eye });
      });
    }
    dark.addEventListener("change", () => show(frames.at()));
    frames.go(0);
  }
})();
