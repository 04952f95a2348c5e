/* Time-space diagrams that can be zoomed: every vehicle's path, coloured by its speed.

   Far away the mean speed of small cells is drawn, near by the paths themselves. All diagrams of a page
   show the same stretch of time and road, so that they can be compared. See time_space.py for the data. */
"use strict";

(function () {
  const MOST_POINTS = 30000; // points in view up to which paths are drawn one by one
  const CELL = 5; // px of a cell of mean speed
  const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");
  const MARGIN = { left: 48, right: 8, top: 8, bottom: 34 };
  const diagrams = [...document.querySelectorAll(".time-space")].map(load);
  if (!diagrams.length) return;
  const whole = {
    from: Math.min(...diagrams.map((d) => d.data.from)), to: Math.max(...diagrams.map((d) => d.data.to)),
    low: Math.min(...diagrams.map((d) => d.data.low)), high: Math.max(...diagrams.map((d) => d.data.high)),
  };
  const view = { ...whole };

  function bytes(text) {
    const binary = atob(text);
    return Uint8Array.from(binary, (character) => character.charCodeAt(0));
  }

  function load(root) {
    const data = JSON.parse(document.getElementById(root.dataset.source).textContent);
    const diagram = {
      root, data, canvas: root.querySelector("canvas"), lane: 0, chosen: null,
      x: new Uint16Array(bytes(data.x).buffer), v: bytes(data.v), lanes: bytes(data.lanes),
    };
    const select = root.querySelector("select");
    select.addEventListener("change", () => { diagram.lane = Number(select.value); drawAll(); });
    return diagram;
  }

  const placeOf = (diagram, point) => diagram.data.low + diagram.x[point] * diagram.data.x_unit;
  const speedOf = (diagram, point) => diagram.v[point] * diagram.data.v_unit;

  /* Calls visit(vehicle, point, time, place) for every point of the lane that lies in view. */
  function eachPoint(diagram, visit) {
    const { first, start, step } = diagram.data;
    for (let vehicle = 0; vehicle < first.length; vehicle += 1) {
      const end = vehicle + 1 < first.length ? first[vehicle + 1] : diagram.x.length;
      const entered = start[vehicle];
      if (entered > view.to || entered + (end - first[vehicle]) * step < view.from) continue;
      for (let point = first[vehicle]; point < end; point += 1) {
        if (diagram.lane && diagram.lanes[point] !== diagram.lane) continue;
        const time = entered + (point - first[vehicle]) * step;
        const place = placeOf(diagram, point);
        if (time >= view.from && time <= view.to && place >= view.low && place <= view.high) visit(vehicle, point, time, place);
      }
    }
  }

  function axes(diagram) {
    const { canvas } = diagram;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = 320;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    canvas.style.height = height + "px";
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const px = (time) => MARGIN.left + ((time - view.from) / (view.to - view.from)) * (width - MARGIN.left - MARGIN.right);
    const py = (place) => height - MARGIN.bottom - ((place - view.low) / (view.high - view.low)) * (height - MARGIN.top - MARGIN.bottom);
    return { c, width, height, px, py };
  }

  function colour(diagram, speed) {
    const { fastest } = diagram.data;
    const colours = darkScheme.matches ? diagram.data.colours_dark : diagram.data.colours;
    return colours[Math.min(colours.length - 1, Math.max(0, Math.floor((speed / fastest) * colours.length)))];
  }

  function draw(diagram) {
    const style = getComputedStyle(document.documentElement);
    const soft = style.getPropertyValue("--soft"), ink = style.getPropertyValue("--ink"), line = style.getPropertyValue("--line");
    const a = axes(diagram), { c } = a;
    let points = 0;
    eachPoint(diagram, () => { points += 1; });
    diagram.mode = points > MOST_POINTS ? "cells" : "paths";
    diagram.root.dataset.mode = diagram.mode;
    diagram.root.dataset.points = String(points);
    if (diagram.mode === "cells") drawCells(diagram, a); else drawPaths(diagram, a);
    if (diagram.chosen !== null) drawChosen(diagram, a, ink);
    drawMarks(diagram, a, ink, style.getPropertyValue("--page"));
    c.fillStyle = soft; c.strokeStyle = line; c.font = "12px system-ui, sans-serif"; c.lineWidth = 1;
    c.strokeRect(MARGIN.left, MARGIN.top, a.width - MARGIN.left - MARGIN.right, a.height - MARGIN.top - MARGIN.bottom);
    c.textAlign = "center";
    for (const time of ticks(view.from, view.to, 6)) c.fillText(clock(time), a.px(time), a.height - 18);
    c.fillText("time since the start (min:s)", a.width / 2, a.height - 3);
    c.textAlign = "right";
    for (const place of ticks(view.low, view.high, 5)) c.fillText(place + " m", MARGIN.left - 4, a.py(place) + 4);
  }

  function drawCells(diagram, { c, width, height, px, py }) {
    const across = Math.ceil(width / CELL), up = Math.ceil(height / CELL);
    const sum = new Float32Array(across * up), count = new Uint16Array(across * up);
    eachPoint(diagram, (_, point, time, place) => {
      const cell = Math.floor(py(place) / CELL) * across + Math.floor(px(time) / CELL);
      sum[cell] += speedOf(diagram, point);
      count[cell] += 1;
    });
    for (let cell = 0; cell < sum.length; cell += 1) {
      if (!count[cell]) continue;
      c.fillStyle = colour(diagram, sum[cell] / count[cell]);
      c.fillRect((cell % across) * CELL, Math.floor(cell / across) * CELL, CELL, CELL);
    }
  }

  function drawPaths(diagram, { c, px, py }) {
    let before = null;
    c.lineWidth = 1.5;
    eachPoint(diagram, (vehicle, point, time, place) => {
      if (before && before.vehicle === vehicle && before.point === point - 1) {
        c.strokeStyle = colour(diagram, speedOf(diagram, point));
        c.beginPath(); c.moveTo(px(before.time), py(before.place)); c.lineTo(px(time), py(place)); c.stroke();
      }
      before = { vehicle, point, time, place };
    });
  }

  function drawChosen(diagram, { c, px, py }, ink) {
    const { first, start, step } = diagram.data;
    const vehicle = diagram.chosen;
    const end = vehicle + 1 < first.length ? first[vehicle + 1] : diagram.x.length;
    c.save();
    c.beginPath(); c.rect(MARGIN.left, MARGIN.top, diagram.canvas.clientWidth, 320 - MARGIN.top - MARGIN.bottom); c.clip();
    c.strokeStyle = ink; c.lineWidth = 3;
    c.beginPath();
    for (let point = first[vehicle]; point < end; point += 1) {
      const time = start[vehicle] + (point - first[vehicle]) * step;
      c.lineTo(px(time), py(placeOf(diagram, point)));
    }
    c.stroke();
    c.restore();
  }

  function drawMarks(diagram, { c, px, py, width }, ink, page) {
    c.font = "12px system-ui, sans-serif"; c.textAlign = "left";
    for (const mark of diagram.data.marks) {
      const left = Math.max(px(mark.time[0] ?? view.from), MARGIN.left), right = Math.min(px(mark.time[1] ?? view.to), width - MARGIN.right);
      const top = Math.max(py(mark.place[1] ?? view.high), MARGIN.top), bottom = Math.min(py(mark.place[0] ?? view.low), 320 - MARGIN.bottom);
      if (right <= left || bottom <= top) continue;
      c.strokeStyle = ink; c.lineWidth = 2; c.setLineDash([7, 4]); c.strokeRect(left, top, right - left, bottom - top); c.setLineDash([]);
      c.fillStyle = page; c.fillRect(left + 2, top + 2, c.measureText(mark.label).width + 6, 16);
      c.fillStyle = ink; c.fillText(mark.label, left + 5, top + 14);
    }
  }

  function ticks(low, high, most) {
    const rough = (high - low) / most;
    const step = [1, 2, 5, 10, 15, 30, 60, 100, 120, 200, 300, 500, 600, 900, 1000, 2000, 5000].find((n) => n >= rough) ?? rough;
    const values = [];
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) values.push(value);
    return values;
  }
  const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.round(seconds % 60)).padStart(2, "0")}`;

  let asked = false;
  function drawAll() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; diagrams.forEach(draw); });
  }

  /* ---------- moving about ---------- */
  function zoom(factor, time, place) {
    const about = (low, high, centre) => [centre - (centre - low) * factor, centre + (high - centre) * factor];
    [view.from, view.to] = about(view.from, view.to, time ?? (view.from + view.to) / 2);
    [view.low, view.high] = about(view.low, view.high, place ?? (view.low + view.high) / 2);
    bound();
  }
  function move(seconds, metres) {
    view.from += seconds; view.to += seconds; view.low += metres; view.high += metres;
    bound();
  }
  function bound() {
    for (const [low, high] of [["from", "to"], ["low", "high"]]) {
      const size = Math.min(Math.max(view[high] - view[low], (whole[high] - whole[low]) / 500), whole[high] - whole[low]);
      view[low] = Math.min(Math.max(view[low], whole[low]), whole[high] - size);
      view[high] = view[low] + size;
    }
    drawAll();
  }

  function spot(diagram, event) {
    const box = diagram.canvas.getBoundingClientRect();
    const across = (event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right);
    const up = 1 - (event.clientY - box.top - MARGIN.top) / (box.height - MARGIN.top - MARGIN.bottom);
    return { time: view.from + across * (view.to - view.from), place: view.low + up * (view.high - view.low) };
  }

  function nearest(diagram, { time, place }) {
    let best = null, least = 0.0006; // squared share of the diagram
    eachPoint(diagram, (vehicle, point, t, x) => {
      const away = ((t - time) / (view.to - view.from)) ** 2 + ((x - place) / (view.high - view.low)) ** 2;
      if (away < least) { least = away; best = { vehicle, point, time: t, place: x }; }
    });
    return best;
  }

  function tell(diagram, found) {
    const text = diagram.root.querySelector(".tell");
    if (!found) { text.textContent = "Point at a path for its vehicle; click to keep it."; return; }
    text.textContent = `vehicle ${diagram.data.ids[found.vehicle]}, lane ${diagram.lanes[found.point]}, `
      + `${speedOf(diagram, found.point).toFixed(1)} m/s at ${found.place.toFixed(0)} m, ${clock(found.time)}`;
  }

  for (const diagram of diagrams) {
    const { canvas, root } = diagram;
    let held = null, dragged = false;
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey && document.activeElement !== canvas) return; // the page scrolls on
      event.preventDefault();
      const { time, place } = spot(diagram, event);
      zoom(event.deltaY > 0 ? 1.25 : 0.8, time, place);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => { held = spot(diagram, event); dragged = false; });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      const here = spot(diagram, event);
      if (held) { dragged = true; move(held.time - here.time, held.place - here.place); } else tell(diagram, nearest(diagram, here));
    });
    canvas.addEventListener("click", (event) => {
      if (dragged) return;
      const found = nearest(diagram, spot(diagram, event));
      diagram.chosen = found ? found.vehicle : null;
      root.dataset.chosen = found ? String(diagram.data.ids[found.vehicle]) : "";
      tell(diagram, found);
      drawAll();
    });
    canvas.addEventListener("keydown", (event) => {
      const width = (view.to - view.from) / 8, height = (view.high - view.low) / 8;
      const moves = { ArrowLeft: [-width, 0], ArrowRight: [width, 0], ArrowUp: [0, height], ArrowDown: [0, -height] };
      if (event.key in moves) move(...moves[event.key]);
      else if (event.key === "+" || event.key === "=") zoom(0.8);
      else if (event.key === "-") zoom(1.25);
      else if (event.key === "0") { Object.assign(view, whole); drawAll(); } else return;
      event.preventDefault();
    });
    root.querySelector("[data-do=nearer]").addEventListener("click", () => zoom(0.6));
    root.querySelector("[data-do=farther]").addEventListener("click", () => zoom(1 / 0.6));
    root.querySelector("[data-do=whole]").addEventListener("click", () => { Object.assign(view, whole); drawAll(); });
    tell(diagram, null);
  }
  window.addEventListener("resize", drawAll);
  darkScheme.addEventListener("change", drawAll);
  drawAll();
})();
