"use strict";
// What one can do with a report: move along the time, zoom, sort. Without this script the tables and the drawing are there
// all the same. Names come from users, so they are only ever set as text.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const duration = data.duration > 0 ? data.duration : 1;
  const seconds = (s) => (s >= 100 ? s.toFixed(1) : s >= 0.1 || s === 0 ? Number(s.toPrecision(4)) : Number((s * 1e3).toPrecision(4)));
  const said = (s) => seconds(s) + (s >= 0.1 || s === 0 ? " s" : " ms");

  // --- the drawing: who is active at a time

  const shapes = new Map();
  for (const group of document.querySelectorAll(".picture g[data-path]")) {
    const rect = group.querySelector(":scope > rect"), path = group.getAttribute("data-path");
    if (rect) shapes.set(path, [...(shapes.get(path) ?? []), rect]);
    if (rect && data.refused[path]) {
      rect.classList.add("refused");
      group.querySelector(":scope > title").textContent += "; not fused: " + data.refused[path];
    }
  }
  const changes = [...new Set(data.active.flatMap((one) => one.spans.flat()))].sort((a, b) => a - b);
  let now = data.duration;

  // A time ends when the next begins, so a node that was active for no time at all is not shown unless one looks just there.
  const isActive = (one, at) => one.spans.some(([begin, end]) => begin <= at && (at < end || (at === end && (begin === end || end >= data.duration))));

  function show(at, playing) {
    now = Math.min(Math.max(at, 0), data.duration);
    const active = data.active.filter((one) => isActive(one, now)).map((one) => one.path);
    const lit = new Set();
    for (const path of active) {
      const parts = path.split("/");
      for (let count = 1; count <= parts.length; count++) lit.add(parts.slice(0, count).join("/"));
    }
    for (const [path, rects] of shapes) rects.forEach((rect) => rect.classList.toggle("hfg-on", lit.has(path)));
    byId("now").textContent = said(now);
    byId("who").textContent = active.length ? active.join(", ") : data.active.length ? "nobody is active" : "";
    byId("time").value = now;
    for (const video of videos) if (video !== playing) video.currentTime = Math.max(0, (now - video.starts) / video.speed);
    drawRows();
  }

  // Whoever plays a video moves the clock, and whoever moves the clock moves the video.
  const videos = [...document.querySelectorAll("video[data-starts]")];
  for (const video of videos) {
    video.starts = Number(video.getAttribute("data-starts"));
    video.speed = Number(video.getAttribute("data-speed"));
    const follow = () => show(video.starts + video.currentTime * video.speed, video);
    let frame = 0;
    const step = () => { follow(); frame = requestAnimationFrame(step); };
    video.addEventListener("play", () => { cancelAnimationFrame(frame); step(); });
    for (const end of ["pause", "ended"]) video.addEventListener(end, () => { cancelAnimationFrame(frame); });
    video.addEventListener("seeked", () => { if (video.matches(":hover")) follow(); });
  }

  byId("time").max = data.duration;
  byId("time").addEventListener("input", (event) => show(Number(event.target.value)));
  byId("before").addEventListener("click", () => { const all = changes.filter((at) => at < now); show(all.length ? all[all.length - 1] : 0); });
  byId("after").addEventListener("click", () => { const next = changes.find((at) => at > now); show(next === undefined ? data.duration : next); });

  for (const drawn of document.querySelectorAll(".own .picture svg")) {
    const room = (drawn.parentElement.clientWidth - 2) / drawn.viewBox.baseVal.width;
    if (room < 1) { drawn.setAttribute("width", "100%"); drawn.removeAttribute("height"); }
  }
  const svg = byId("graph").querySelector("svg");
  const width = svg ? svg.viewBox.baseVal.width : 1, height = svg ? svg.viewBox.baseVal.height : 1;
  let zoom = 1;
  function scale(by) {
    zoom = Math.min(Math.max(by, 0.05), 4);
    if (!svg) return; // the graph is too large for a drawing
    svg.setAttribute("width", width * zoom);
    svg.setAttribute("height", height * zoom);
  }
  const fit = () => scale(Math.min(1, (byId("graph").clientWidth - 2) / width));
  byId("fit").addEventListener("click", fit);
  byId("larger").addEventListener("click", () => scale(zoom * 1.25));
  byId("smaller").addEventListener("click", () => scale(zoom / 1.25));

  // --- the timeline

  const canvas = byId("rows"), LABEL = 240, ROW = 18, AXIS = 22;
  let from = 0, to = duration, rows = [];

  function groupRows() {
    const sums = new Map();
    for (const [path, counts] of Object.entries(data.counts)) {
      const group = data.groups[path] ?? "loop";
      const sum = sums.get(group) ?? new Array(counts.length).fill(0);
      counts.forEach((count, index) => { sum[index] += count; });
      sums.set(group, sum);
    }
    return [...sums].map(([group, counts]) => ({ name: group === "loop" ? "firings on the loop" : "firings of group " + group, counts }));
  }

  function chooseRows() {
    rows = data.active.map((one) => ({ name: one.path, spans: one.spans }));
    rows.push(...groupRows());
    if (byId("all").checked) rows.push(...Object.entries(data.counts).map(([path, counts]) => ({ name: "firings of " + path, counts })));
  }

  function fitted(context, text, room) {
    if (context.measureText(text).width <= room) return text;
    let cut = text;
    while (cut.length > 1 && context.measureText("…" + cut).width > room) cut = cut.slice(1);
    return "…" + cut;
  }

  function drawRows() {
    const ratio = window.devicePixelRatio || 1;
    const wide = Math.max(canvas.parentElement.clientWidth, 480), high = AXIS + ROW * rows.length + 6;
    canvas.width = wide * ratio;
    canvas.height = high * ratio;
    canvas.style.width = wide + "px";
    canvas.style.height = high + "px";
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    const room = wide - LABEL - 12, x = (at) => LABEL + ((at - from) / (to - from)) * room;
    const ink = style("--ink"), soft = style("--soft"), rule = style("--rule"), on = style("--on"), work = style("--work");
    const step = niceStep((to - from) / Math.max(room / 90, 1));
    for (let tick = Math.ceil(from / step) * step; tick <= to + step * 1e-9; tick += step) {
      context.fillStyle = rule;
      context.fillRect(x(tick), AXIS - 4, 1, high - AXIS);
      context.fillStyle = soft;
      context.fillText(said(Math.abs(tick) < step * 1e-6 ? 0 : tick), x(tick) + 3, 13);
    }
    rows.forEach((row, index) => {
      const y = AXIS + index * ROW;
      if (index % 2) { context.fillStyle = style("--band"); context.fillRect(0, y, LABEL - 6, ROW); }
      context.fillStyle = ink;
      context.fillText(fitted(context, row.name, LABEL - 18), 6, y + 13);
      context.save();
      context.beginPath();
      context.rect(LABEL, y, room + 2, ROW);
      context.clip();
      if (row.spans) {
        context.fillStyle = on;
        for (const [begin, end] of row.spans) {
          if (end < from || begin > to) continue;
          context.fillRect(x(begin), y + 3, Math.max(x(end) - x(begin), 1.5), ROW - 6);
        }
      } else {
        const most = Math.max(...row.counts, 1);
        context.fillStyle = work;
        row.counts.forEach((count, span) => {
          if (!count) return;
          const tall = Math.max(1.5, (ROW - 5) * (count / most));
          context.fillRect(x(span * data.span), y + ROW - 2 - tall, Math.max(x((span + 1) * data.span) - x(span * data.span) - 0.3, 1), tall);
        });
      }
      context.restore();
    });
    if (now >= from && now <= to) {
      context.fillStyle = ink;
      context.fillRect(x(now) - 0.75, 0, 1.5, high);
    }
  }

  function niceStep(raw) {
    const power = 10 ** Math.floor(Math.log10(raw));
    return power * [1, 2, 5, 10].find((factor) => factor * power >= raw);
  }

  const timeAt = (event) => from + ((event.offsetX - LABEL) / (canvas.clientWidth - LABEL - 12)) * (to - from);
  let pressed = false;
  canvas.addEventListener("pointerdown", (event) => { pressed = true; canvas.setPointerCapture(event.pointerId); show(timeAt(event)); });
  canvas.addEventListener("pointerup", () => { pressed = false; });
  canvas.addEventListener("pointermove", (event) => {
    if (pressed) show(timeAt(event));
    const row = rows[Math.floor((event.offsetY - AXIS) / ROW)], at = timeAt(event);
    const span = row && row.spans && row.spans.find(([begin, end]) => begin <= at && at <= end);
    canvas.title = row ? row.name + (span ? ": active from " + said(span[0]) + " to " + said(span[1]) : "") : "";
  });

  function zoomTime(factor) {
    const middle = now >= from && now <= to ? now : (from + to) / 2;
    const half = Math.min(((to - from) / 2) * factor, duration / 2);
    from = Math.max(0, Math.min(middle - half, duration - 2 * half));
    to = from + 2 * half;
    drawRows();
  }
  byId("in").addEventListener("click", () => zoomTime(0.5));
  byId("out").addEventListener("click", () => zoomTime(2));
  byId("whole").addEventListener("click", () => { from = 0; to = duration; drawRows(); });
  byId("all").addEventListener("change", () => { chooseRows(); drawRows(); });
  window.addEventListener("resize", drawRows);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawRows);

  for (const figure of document.querySelectorAll("figure[data-time]")) {
    figure.addEventListener("click", () => { show(Number(figure.getAttribute("data-time"))); });
  }

  chooseRows();
  fit();
  show(data.duration);
})();
