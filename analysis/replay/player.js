/* Plays one replay: the road from above, three curves with a cursor, and the figures of the moment.

   The page holds the data as JSON in #replay-data (see player.py for its fields). Positions are metres,
   x downstream and y to the left, of the front bumper's centre; one entry a frame. */
"use strict";

(function () {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const frames = data.recorded.x.length;
  const duration = (frames - 1) * data.step;
  const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");
  const element = (id) => document.getElementById(id);
  const state = { frame: 0, playing: false, speed: 1, view: 140, shown: new Set(data.models.filter((m) => m.shown).map((m) => m.key)) };

  /* ---------- colours follow the page's theme ---------- */
  let theme = {};
  function readTheme() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "soft", "line", "page", "road", "traffic", "leader"]) {
      theme[name] = style.getPropertyValue("--" + name).trim();
    }
  }
  const inkOf = (model) => (darkScheme.matches ? model.colour_dark : model.colour);

  /* A canvas is as sharp as the screen and as wide as its column. */
  function prepare(canvas, height) {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      canvas.style.height = height + "px";
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = "12px system-ui, sans-serif";
    return { context, width, height };
  }

  /* Values lie on whole frames; between two of them the car is drawn on the straight line. */
  function at(values, frame) {
    const below = Math.floor(frame);
    const part = frame - below;
    const first = values[below];
    const second = part > 0 ? values[below + 1] : first;
    if (first === null || second === null || first === undefined || second === undefined) return first ?? null;
    return first + part * (second - first);
  }

  /* ---------- the road from above: one for all models, or one a model below each other ---------- */
  const roads = data.apart ? data.models.map(addRoad) : [{ canvas: element("road"), own: null }];
  if (data.apart) element("road").remove();

  function addRoad(model) {
    const figure = document.createElement("figure");
    const name = document.createElement("figcaption");
    const canvas = document.createElement("canvas");
    name.textContent = model.name;
    canvas.className = "road";
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", element("road").getAttribute("aria-label") + ": " + model.name);
    figure.append(name, canvas);
    element("roads").append(figure);
    return { canvas, own: model };
  }
  function roadHeight() {
    const top = Math.max(...data.road.edges, 0) + 1;
    const bottom = Math.min(...data.road.edges, ...data.road.sides.map((side) => side.to_y)) - 1;
    return { top, bottom };
  }
  const extent = roadHeight();

  function drawRoad({ canvas, own: only }) {
    const models = visibleModels().filter((model) => only === null || model === only);
    const scale = canvas.clientWidth / state.view;
    const across = Math.max(scale, 5); // px a metre across: lanes stay apart on a phone
    const area = prepare(canvas, Math.round((extent.top - extent.bottom) * across) + 18);
    const c = area.context;
    const middle = at(data.recorded.x, state.frame) + state.view * 0.12;
    const px = (x) => (x - middle) * scale + area.width / 2;
    const py = (y) => (extent.top - y) * across;
    drawLanes(c, area, px, py, middle);
    for (const vehicle of data.traffic) drawTraffic(c, area, vehicle, px, py, scale, across);
    for (const model of models) drawFan(c, model, px, py);
    const own = { length: data.recorded.length, width: data.recorded.width };
    drawCar(c, data.recorded, state.frame, own, theme.ink, px, py, scale, across, true);
    for (const model of models) drawCar(c, model, state.frame, own, inkOf(model), px, py, scale, across, false);
    labelCars(c, area, models, px, py);
  }

  function drawLanes(c, area, px, py, middle) {
    const from = middle - state.view, to = middle + state.view;
    c.fillStyle = theme.road;
    const edges = data.road.edges;
    c.fillRect(0, py(edges[0]), area.width, py(edges[edges.length - 1]) - py(edges[0]));
    for (const side of data.road.sides) {
      const start = Math.max(side.from_x ?? from, from), end = Math.min(side.to_x ?? to, to);
      if (end > start) c.fillRect(px(start), py(side.from_y), px(end) - px(start), py(side.to_y) - py(side.from_y));
    }
    c.strokeStyle = theme.line;
    edges.forEach((y, lane) => {
      const border = lane === 0 || lane === edges.length - 1;
      c.setLineDash(border ? [] : [10, 12]);
      c.lineDashOffset = border ? 0 : px(0);
      c.lineWidth = border ? 1.5 : 1;
      c.beginPath(); c.moveTo(0, py(y)); c.lineTo(area.width, py(y)); c.stroke();
    });
    c.setLineDash([]);
    c.fillStyle = theme.soft;
    c.textAlign = "center";
    const every = state.view > 250 ? 100 : 50;
    for (let x = Math.ceil(from / every) * every; x <= to; x += every) {
      if (px(x) > 20 && px(x) < area.width - 20) c.fillText(x + " m", px(x), area.height - 4);
    }
    for (const side of data.road.sides) {
      const x = Math.min(Math.max(px(((side.from_x ?? from) + (side.to_x ?? to)) / 2), 60), area.width - 60);
      const seen = px(side.to_x ?? to) > 120 && px(side.from_x ?? from) < area.width - 120;
      if (seen) c.fillText(side.name, x, py((side.from_y + side.to_y) / 2) + 4);
    }
  }

  function body(c, x, y, heading, length, width, px, py, scale, across) {
    c.save();
    c.translate(px(x), py(y));
    c.rotate(-Math.atan2(Math.sin(heading) * across, Math.cos(heading) * scale));
    c.beginPath();
    c.roundRect(-length * scale, (-width * across) / 2, length * scale, width * across, Math.min(3, width * across / 3));
    c.restore();
  }

  function drawTraffic(c, area, vehicle, px, py, scale, across) {
    const frame = state.frame - vehicle.first;
    if (frame < 0 || frame > vehicle.x.length - 1) return;
    const x = at(vehicle.x, frame), y = at(vehicle.y, frame);
    if (Math.abs(px(x) - area.width / 2) > area.width) return;
    const isLeader = vehicle.id === data.recorded.leader[Math.round(state.frame)];
    body(c, x, y, at(vehicle.h, frame), vehicle.length, vehicle.width, px, py, scale, across);
    c.fillStyle = theme.traffic;
    c.fill();
    if (isLeader) {
      c.strokeStyle = theme.leader; c.lineWidth = 2.5; c.stroke();
      c.fillStyle = theme.leader; c.textAlign = "center";
      c.fillText("leader " + vehicle.id, px(x - vehicle.length / 2), Math.max(py(y + vehicle.width / 2) - 4, 11));
    }
  }

  function drawCar(c, car, frame, size, colour, px, py, scale, across, outlined) {
    const x = at(car.x, frame), y = at(car.y, frame);
    if (x === null || y === null) return;
    body(c, x, y, at(car.h, frame), size.length, size.width, px, py, scale, across);
    c.lineWidth = 2.5;
    if (outlined) {
      c.strokeStyle = colour; c.stroke(); // the recorded car is an outline, so that a modelled one is seen inside it
    } else {
      c.globalAlpha = 0.75; c.fillStyle = colour; c.fill(); c.globalAlpha = 1;
    }
  }

  function drawFan(c, model, px, py) {
    for (const band of model.fan) {
      const low = at(band.low, state.frame), high = at(band.high, state.frame), y = at(model.y, state.frame);
      if (low === null || high === null) continue;
      c.globalAlpha = 0.18;
      c.fillStyle = inkOf(model);
      c.fillRect(px(low), py(y + 1.6), px(high) - px(low), py(y - 1.6) - py(y + 1.6));
      c.globalAlpha = 1;
    }
  }

  function labelCars(c, area, models, px, py) {
    const cars = [{ name: "recorded", colour: theme.ink, car: data.recorded }];
    for (const model of models) cars.push({ name: model.name, colour: inkOf(model), car: model });
    let row = 0;
    c.textAlign = "left";
    for (const { name, colour, car } of cars) {
      const x = px(at(car.x, state.frame)), y = py(at(car.y, state.frame));
      const labelX = Math.min(Math.max(x + 4, 2), area.width - 110);
      const labelY = Math.min(area.height - 22, y + 20 + 15 * row);
      c.globalAlpha = 0.8; c.fillStyle = theme.page; // a car behind the name must not make it unreadable
      c.fillRect(labelX - 2, labelY - 11, 19 + c.measureText(name).width, 15);
      c.globalAlpha = 1; c.fillStyle = colour;
      c.fillRect(labelX, labelY - 9, 9, 9);
      c.fillStyle = theme.ink; // text keeps its contrast whatever the model's colour
      c.fillText(name, labelX + 13, labelY);
      row += 1;
    }
  }

  /* ---------- curves ---------- */
  const curves = [
    { id: "speed", of: "v", unit: "m/s" },
    { id: "gap", of: "gap", unit: "m" },
    { id: "acceleration", of: "a", unit: "m/s²" },
  ];
  const visibleModels = () => data.models.filter((model) => state.shown.has(model.key));

  function range(of) {
    let low = Infinity, high = -Infinity;
    for (const one of [data.recorded, ...data.models]) {
      for (const value of one[of]) {
        if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
      }
    }
    if (!Number.isFinite(low)) return [0, 1];
    const margin = Math.max((high - low) * 0.08, 0.2);
    return [low - margin, high + margin];
  }

  const MARGIN = { left: 46, right: 22, top: 8, bottom: 18 };
  function drawCurve(curve) {
    const canvas = element(curve.id);
    const { context: c, width, height } = prepare(canvas, 120);
    const [low, high] = range(curve.of);
    const px = (frame) => MARGIN.left + (frame / (frames - 1)) * (width - MARGIN.left - MARGIN.right);
    const py = (value) => MARGIN.top + ((high - value) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);
    c.strokeStyle = theme.line; c.fillStyle = theme.soft; c.lineWidth = 1; c.textAlign = "right";
    for (const value of ticks(low, high)) {
      c.beginPath(); c.moveTo(MARGIN.left, py(value)); c.lineTo(width - MARGIN.right, py(value)); c.stroke();
      c.fillText(String(value), MARGIN.left - 6, py(value) + 4);
    }
    c.textAlign = "center";
    for (let s = 0; s <= duration + 1e-9; s += duration > 6 ? 2 : 1) c.fillText(s + " s", px(s / data.step), height - 3);
    line(c, data.recorded[curve.of], theme.ink, [], 2, px, py);
    for (const model of visibleModels()) line(c, model[curve.of], inkOf(model), model.dash, 2, px, py);
    c.strokeStyle = theme.leader; c.lineWidth = 1.5; c.setLineDash([]);
    c.beginPath(); c.moveTo(px(state.frame), MARGIN.top); c.lineTo(px(state.frame), height - MARGIN.bottom); c.stroke();
  }

  function ticks(low, high) {
    const rough = (high - low) / 5;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
    const values = [];
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) values.push(Number(value.toPrecision(6)));
    return values;
  }

  function line(c, values, colour, dash, width, px, py) {
    c.strokeStyle = colour; c.lineWidth = width; c.setLineDash(dash);
    c.beginPath();
    let drawing = false;
    values.forEach((value, frame) => {
      if (value === null) { drawing = false; return; }
      if (drawing) c.lineTo(px(frame), py(value)); else c.moveTo(px(frame), py(value));
      drawing = true;
    });
    c.stroke();
    c.setLineDash([]);
  }

  /* ---------- the moment in figures ---------- */
  const show = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
  function fillMoment() {
    const rows = [{ name: "recorded", car: data.recorded, model: null }];
    for (const model of visibleModels()) rows.push({ name: model.name, car: model, model });
    const table = element("moment");
    table.replaceChildren();
    for (const { name, car, model } of rows) {
      const apart = model === null ? null
        : Math.hypot(at(car.x, state.frame) - at(data.recorded.x, state.frame), at(car.y, state.frame) - at(data.recorded.y, state.frame));
      const row = table.insertRow();
      [name, show(at(car.v, state.frame), 1), show(at(car.gap, state.frame), 1), show(at(car.a, state.frame), 2), show(apart, 2)]
        .forEach((text) => { row.insertCell().textContent = text; });
    }
  }

  /* ---------- one frame of everything ---------- */
  let asked = false;
  function render() {
    asked = false;
    roads.forEach(drawRoad);
    curves.forEach(drawCurve);
    fillMoment();
    const scrub = element("scrub");
    scrub.value = String(state.frame);
    const clock = (state.frame * data.step).toFixed(1) + " s";
    element("clock").textContent = clock + " of " + duration.toFixed(1) + " s";
    scrub.setAttribute("aria-valuetext", clock);
    document.body.dataset.frame = String(state.frame);
    document.body.dataset.playing = String(state.playing);
  }
  function ask() {
    if (!asked) { asked = true; requestAnimationFrame(render); }
  }

  function go(frame) {
    state.frame = Math.min(Math.max(frame, 0), frames - 1);
    ask();
  }

  let last = 0;
  let drawn = 0;
  function tick(now) {
    if (!state.playing) return;
    const passed = Math.min((now - last) / 1000, 0.1);
    last = now;
    drawn += 1;
    document.body.dataset.drawn = String(drawn);
    state.frame += (passed * state.speed) / data.step;
    if (state.frame >= frames - 1) { state.frame = frames - 1; play(false); }
    render();
    if (state.playing) requestAnimationFrame(tick);
  }
  function play(on) {
    if (on && state.frame >= frames - 1) state.frame = 0;
    state.playing = on;
    element("play").textContent = on ? "Pause" : "Play";
    element("play").setAttribute("aria-pressed", String(on));
    if (on) { last = performance.now(); requestAnimationFrame(tick); } else ask();
  }

  /* ---------- controls ---------- */
  element("scrub").max = String(frames - 1);
  element("scrub").addEventListener("input", (event) => { play(false); go(Number(event.target.value)); });
  element("play").addEventListener("click", () => play(!state.playing));
  element("back").addEventListener("click", () => { play(false); go(Math.ceil(state.frame) - 1); });
  element("next").addEventListener("click", () => { play(false); go(Math.floor(state.frame) + 1); });
  element("pace").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
  element("view").addEventListener("input", (event) => { state.view = Number(event.target.value); ask(); });
  for (const model of data.models) addSwitch(model);
  for (const curve of curves) {
    const canvas = element(curve.id);
    canvas.addEventListener("pointerdown", (event) => { play(false); seek(canvas, event); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) seek(canvas, event); });
  }

  function seek(canvas, event) {
    const box = canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right);
    go(Math.round(share * (frames - 1)));
  }

  function addSwitch(model) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox"; box.checked = model.shown; box.value = model.key;
    box.addEventListener("change", () => {
      if (box.checked) state.shown.add(model.key); else state.shown.delete(model.key);
      ask();
    });
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.dataset.key = model.key;
    label.append(box, swatch, document.createTextNode(model.name));
    element("models").append(label);
  }
  function colourSwitches() {
    for (const swatch of document.querySelectorAll(".swatch")) {
      swatch.style.background = inkOf(data.models.find((model) => model.key === swatch.dataset.key));
    }
  }

  document.addEventListener("keydown", (event) => {
    if (event.target.matches?.("select, input[type=checkbox], button") && event.key === " ") return;
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };
    if (event.key === " ") play(!state.playing);
    else if (event.key in steps) { play(false); go(Math.round(state.frame) + steps[event.key]); }
    else if (event.key === "Home") { play(false); go(0); }
    else if (event.key === "End") { play(false); go(frames - 1); }
    else return;
    event.preventDefault();
  });

  function restyle() { readTheme(); colourSwitches(); ask(); }
  darkScheme.addEventListener("change", restyle);
  window.addEventListener("resize", ask);
  restyle();
})();
