// View of umbravox.Widget: pointer, wheel and keys change the state, and the kernel answers with a picture.

const DEGREES_PER_PIXEL = 0.4;
const KEY_STEP_DEG = 5;
const MAX_ELEVATION_DEG = 89;
const DISTANCES = [0.05, 20];
// Time after the last turn of the wheel or key until the full picture is requested, ms.
const REST_MS = 300;
const STATE = ["azimuth_deg", "elevation_deg", "distance", "light_direction", "opacity_points"];
const SVG = "http://www.w3.org/2000/svg";

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((x) => s * x);
const sum = (...all) => [0, 1, 2].map((i) => all.reduce((total, a) => total + a[i], 0));
const unit = (a) => scaled(a, 1 / Math.hypot(...a));
const rounded4 = (x) => Number(x.toPrecision(4)).toString();
const radians = (deg) => (deg * Math.PI) / 180;

// Rotates a vector about a unit axis.
function rotated(v, axis, angle) {
  const c = Math.cos(angle);
  return sum(scaled(v, c), scaled(cross(axis, v), Math.sin(angle)), scaled(axis, (1 - c) * dot(axis, v)));
}

function setAttributes(node, attributes) {
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  return node;
}

function element(name, className, parent, attributes = {}) {
  const made = setAttributes(document.createElement(name), { class: className, ...attributes });
  parent.append(made);
  return made;
}

function shape(name, parent, attributes) {
  const made = setAttributes(document.createElementNS(SVG, name), attributes);
  parent.append(made);
  return made;
}

// State of this page, and its requests of pictures, one at a time. While one is drawn, only the newest of the next
// requests is kept. Meanwhile messages of the kernel have older states, so that none of them is taken over.
class View {
  constructor(model) {
    Object.assign(this, { model, state: {}, count: 0, sent: null, next: null, rest: 0, latency: null, listeners: [] });
    this.name = Math.random().toString(36).slice(2);
    this.adopt();
  }

  // Takes over the state of the model, unless this page is ahead of it.
  adopt() {
    if (this.sent || this.next) return;
    for (const name of STATE) this.state[name] = this.model.get(name);
    this.tell();
  }

  // Camera and light of the scene.
  reset() {
    Object.assign(this.state, { ...this.model.get("_home"), opacity_points: this.state.opacity_points });
  }

  tell() {
    for (const listener of this.listeners) listener();
  }

  ask(drag) {
    clearTimeout(this.rest);
    this.next = { drag };
    this.send();
  }

  // A small picture now, and the full one when nothing has changed for a moment.
  askUntilRest() {
    this.ask(true);
    this.rest = setTimeout(() => this.ask(false), REST_MS);
  }

  send() {
    if (!this.sent && this.next) {
      this.sent = { id: `${this.name}-${++this.count}`, ...this.next };
      this.next = null;
      this.started = performance.now();
      for (const name of STATE) this.model.set(name, this.state[name]);
      this.model.set("_request", this.sent);
      this.model.save_changes();
    }
    this.tell();
  }

  answered() {
    if (!this.sent || this.model.get("_answer").id !== this.sent.id) return;
    this.sent = null;
    this.latency = performance.now() - this.started;
    this.send();
    this.adopt();
  }
}

// Directions of the picture in world coordinates.
function frame({ model, state }) {
  const [x, y, z] = model.get("_axes");
  const [a, e] = [radians(state.azimuth_deg), radians(state.elevation_deg)];
  const across = sum(scaled(x, Math.cos(a)), scaled(y, Math.sin(a)));
  const away = sum(scaled(across, Math.cos(e)), scaled(z, Math.sin(e)));
  const right = unit(cross(z, away));
  return { away, right, up: cross(away, right) };
}

function turn({ state }, right, down) {
  const azimuth = state.azimuth_deg - right;
  state.azimuth_deg = azimuth - 360 * Math.round(azimuth / 360);
  state.elevation_deg = clamp(state.elevation_deg + down, -MAX_ELEVATION_DEG, MAX_ELEVATION_DEG);
}

function turnLight(view, right, down) {
  const { right: side, up } = frame(view);
  const toward = rotated(rotated(view.state.light_direction, side, radians(down)), up, radians(right));
  view.state.light_direction = unit(toward);
}

function zoom({ state }, factor) {
  state.distance = clamp(state.distance * factor, ...DISTANCES);
}

// A mouse or one finger turns, two fingers zoom.
function pointerControls(stage, view) {
  // Places of the pressed pointers by their number.
  const pressed = new Map();
  const place = ({ clientX, clientY }) => [clientX, clientY];
  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pressed.size === 2) return;
    stage.setPointerCapture(event.pointerId);
    stage.focus({ preventScroll: true });
    event.preventDefault();
    pressed.set(event.pointerId, place(event));
  });
  stage.addEventListener("pointermove", (event) => {
    const [last, here] = [pressed.get(event.pointerId), place(event)];
    if (!last) return;
    pressed.set(event.pointerId, here);
    const moved = [0, 1].map((axis) => here[axis] - last[axis]);
    if (pressed.size === 2) {
      const [other] = [...pressed].filter(([number]) => number !== event.pointerId).map(([, at]) => at);
      const [before, after] = [last, here].map((at) => Math.hypot(at[0] - other[0], at[1] - other[1]));
      zoom(view, clamp(before / Math.max(after, 1), 0.5, 2));
    } else {
      (event.shiftKey ? turnLight : turn)(view, ...moved.map((pixels) => DEGREES_PER_PIXEL * pixels));
    }
    view.ask(true);
  });
  const end = (event) => {
    if (pressed.delete(event.pointerId)) view.ask(pressed.size > 0);
  };
  stage.addEventListener("pointerup", end);
  stage.addEventListener("pointercancel", end);
  const onWheel = (event) => {
    event.preventDefault();
    // Lines and pages of some mice, in pixels.
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    zoom(view, Math.exp(0.001 * clamp(pixels, -400, 400)));
    view.askUntilRest();
  };
  stage.addEventListener("wheel", onWheel, { passive: false });
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

// Calls `act` for keys; those for which it returns false are the notebook's.
function onKeys(node, act) {
  node.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || act(event) === false) return;
    event.preventDefault();
    event.stopPropagation();
  });
}

function keyControls(stage, view) {
  onKeys(stage, ({ key, shiftKey }) => {
    if (key in ARROWS) (shiftKey ? turnLight : turn)(view, ...ARROWS[key].map((sign) => sign * KEY_STEP_DEG));
    else if (key === "+" || key === "=") zoom(view, 1 / 1.1);
    else if (key === "-") zoom(view, 1.1);
    else if (key === "Home") view.reset();
    else return false;
    view.askUntilRest();
  });
}

// Disc with the direction of the light: its centre is a light at the camera, its rim one behind the volume.
function lightDisc(parent, view) {
  const svg = shape("svg", parent, { viewBox: "-1.15 -1.15 2.3 2.3", class: "ux-disc", "aria-hidden": "true" });
  shape("circle", svg, { r: 1, class: "ux-disc-rim" });
  shape("circle", svg, { r: 0.5, class: "ux-disc-side" });
  const ray = shape("line", svg, { x1: 0, y1: 0, class: "ux-disc-ray" });
  const light = shape("circle", svg, { r: 0.16, class: "ux-disc-light" });
  return () => {
    const { away, right, up } = frame(view);
    const toward = view.state.light_direction;
    const [x, y] = [dot(toward, right), dot(toward, up)];
    const radius = Math.acos(clamp(dot(toward, away), -1, 1)) / Math.PI;
    const across = Math.hypot(x, y) || 1;
    const [cx, cy] = [(radius * x) / across, (-radius * y) / across];
    setAttributes(ray, { x2: cx, y2: cy });
    setAttributes(light, { cx, cy });
  };
}

const [WIDTH, HEIGHT, MARGIN] = [480, 110, 8];

// Editor of the opacity points over the range of values.
class Opacity {
  constructor(parent, view) {
    Object.assign(this, { view, dragged: null, chosen: null });
    this.axes = view.model.get("_editor");
    this.isOpacity = this.axes.quantity.startsWith("opacity");
    const box = element("div", "ux-editor", parent);
    const head = element("div", "ux-editor-head", box);
    element("span", "", head).textContent = `${this.axes.quantity} (∛ axis)`;
    this.reading = element("span", "ux-reading", head);
    const label = "Opacity points: arrow keys move a point, Delete removes it, Enter adds one beside it";
    const attributes = { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "ux-curve", role: "group", "aria-label": label };
    this.svg = shape("svg", box, attributes);
    this.histogram();
    this.gradient();
    this.area = shape("path", this.svg, { class: "ux-area", fill: `url(#${this.gradientId})` });
    this.line = shape("path", this.svg, { class: "ux-line" });
    this.handles = shape("g", this.svg, {});
    const ends = element("div", "ux-editor-ends", box);
    for (const end of this.axes.range) element("span", "", ends).textContent = rounded4(end);
    this.svg.addEventListener("dblclick", (event) => this.add(...this.at(event)));
    this.svg.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      // JupyterLab opens a menu of its own.
      event.stopPropagation();
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (this.dragged !== null) this.move(this.dragged, ...this.at(event));
    });
    for (const name of ["pointerup", "pointercancel"]) this.svg.addEventListener(name, () => this.drop());
    this.fit();
    this.draw();
  }

  get points() {
    return this.view.state.opacity_points;
  }

  // The largest opacity of the axis leaves room above the highest point.
  fit() {
    const highest = Math.max(...this.points.map((point) => point[1]), 1e-9);
    this.most = this.isOpacity ? Math.min(1, 1.3 * highest) : 1.3 * highest;
  }

  x(value) {
    const [low, high] = this.axes.range;
    return MARGIN + ((value - low) / (high - low)) * (WIDTH - 2 * MARGIN);
  }

  y(amount) {
    return HEIGHT - MARGIN - this.share(amount) * (HEIGHT - 2 * MARGIN);
  }

  // Opacities of soft tissue and of bone differ by a factor of hundreds: the axis is one of cube roots.
  share(amount) {
    return Math.cbrt(Math.min(amount / this.most, 1));
  }

  amount(share) {
    return this.most * clamp(share, 0, 1) ** 3;
  }

  // Value and opacity under the pointer.
  at(event) {
    const box = this.svg.getBoundingClientRect();
    const [low, high] = this.axes.range;
    const across = ((event.clientX - box.left) * WIDTH) / box.width;
    const down = ((event.clientY - box.top) * HEIGHT) / box.height;
    const value = low + ((across - MARGIN) / (WIDTH - 2 * MARGIN)) * (high - low);
    return [clamp(value, low, high), this.amount((HEIGHT - MARGIN - down) / (HEIGHT - 2 * MARGIN))];
  }

  histogram() {
    const bars = this.axes.histogram;
    const step = (WIDTH - 2 * MARGIN) / bars.length;
    const parts = bars.map((share, i) => {
      const top = HEIGHT - MARGIN - share * (HEIGHT - 2 * MARGIN);
      return `L${MARGIN + i * step},${top} L${MARGIN + (i + 1) * step},${top}`;
    });
    const path = `M${MARGIN},${HEIGHT - MARGIN} ${parts.join(" ")} L${WIDTH - MARGIN},${HEIGHT - MARGIN} Z`;
    shape("path", this.svg, { class: "ux-histogram", d: path });
  }

  gradient() {
    this.gradientId = `ux-colors-${Math.random().toString(36).slice(2)}`;
    const ends = { gradientUnits: "userSpaceOnUse", x1: MARGIN, x2: WIDTH - MARGIN, y1: 0, y2: 0 };
    const gradient = shape("linearGradient", this.svg, { id: this.gradientId, ...ends });
    const [low, high] = this.axes.range;
    for (const [value, color] of this.axes.colors) {
      shape("stop", gradient, { offset: (value - low) / (high - low), "stop-color": color });
    }
  }

  draw() {
    const places = this.points.map(([value, amount]) => [this.x(value), this.y(amount)]);
    const [low, high] = this.axes.range;
    const ends = [[low, this.points[0][1]], ...this.points, [high, this.points[this.points.length - 1][1]]];
    const curve = ends.flatMap((end, i) => this.segment(ends[i - 1] ?? end, end)).join(" L");
    this.line.setAttribute("d", `M${curve}`);
    this.area.setAttribute("d", `M${MARGIN},${HEIGHT - MARGIN} L${curve} L${WIDTH - MARGIN},${HEIGHT - MARGIN} Z`);
    while (this.handles.children.length > places.length) this.handles.lastChild.remove();
    while (this.handles.children.length < places.length) this.handle(this.handles.children.length);
    places.forEach(([cx, cy], i) => {
      const [value, amount] = this.points[i].map(rounded4);
      const name = i === this.chosen ? "ux-handle ux-chosen" : "ux-handle";
      const read = { "aria-valuenow": amount, "aria-valuetext": `${amount} at ${value}` };
      setAttributes(this.handles.children[i], { cx, cy, class: name, ...read });
    });
    const shown = this.points[this.chosen];
    const hint = "double click: add · right click: remove";
    this.reading.textContent = shown ? `${rounded4(shown[1])} at ${rounded4(shown[0])}` : hint;
  }

  // Opacity is linear between two points, and so curved on this axis.
  segment(start, end) {
    const steps = start[1] === end[1] || start[0] === end[0] ? 1 : 24;
    return Array.from({ length: steps }, (_, i) => {
      // Closer together at both ends, where the cube root is steep.
      const at = (1 - Math.cos((Math.PI * (i + 1)) / steps)) / 2;
      const [value, amount] = [0, 1].map((k) => start[k] + at * (end[k] - start[k]));
      return `${this.x(value).toFixed(2)},${this.y(amount).toFixed(2)}`;
    });
  }

  handle(i) {
    const role = { tabindex: 0, role: "slider", "aria-label": `Opacity point ${i + 1}` };
    const handle = shape("circle", this.handles, { r: 5.5, ...role });
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      if (event.button === 2) this.remove(i);
      if (event.button !== 0) return;
      this.svg.setPointerCapture(event.pointerId);
      handle.focus({ preventScroll: true });
      this.dragged = i;
    });
    // A double click on a point adds none.
    handle.addEventListener("dblclick", (event) => event.stopPropagation());
    const choose = (chosen) => () => {
      this.chosen = chosen;
      this.draw();
    };
    handle.addEventListener("focus", choose(i));
    handle.addEventListener("blur", choose(null));
    onKeys(handle, (event) => this.key(event.key, i));
  }

  set(points, drag) {
    this.view.state.opacity_points = points;
    if (drag) this.view.askUntilRest();
    else this.view.ask(false);
  }

  // A point stays between its neighbours.
  move(i, value, amount) {
    const points = this.points.map((point) => [...point]);
    const [low, high] = this.axes.range;
    const between = [points[i - 1]?.[0] ?? low, points[i + 1]?.[0] ?? high];
    points[i] = [clamp(value, ...between), this.isOpacity ? clamp(amount, 0, 1) : Math.max(amount, 0)];
    this.set(points, true);
  }

  drop() {
    if (this.dragged === null) return;
    this.dragged = null;
    this.fit();
    this.view.ask(false);
  }

  add(value, amount) {
    const points = [...this.points, [value, amount]].sort((a, b) => a[0] - b[0]);
    this.set(points, false);
    this.handles.children[points.findIndex((point) => point[0] === value)].focus();
  }

  remove(i) {
    if (this.points.length < 2) return;
    this.chosen = null;
    this.set(this.points.filter((_, at) => at !== i), false);
    this.fit();
    this.draw();
  }

  key(key, i) {
    const [low, high] = this.axes.range;
    const [value, amount] = this.points[i];
    if (key in ARROWS) {
      const [across, down] = ARROWS[key];
      this.move(i, value + 0.01 * across * (high - low), this.amount(this.share(amount) - 0.05 * down));
    } else if (key === "Delete" || key === "Backspace") this.remove(i);
    else if (key === "Enter") {
      const next = this.points[i + 1] ?? [high, amount];
      this.add((value + next[0]) / 2, (amount + next[1]) / 2);
    } else return false;
  }
}

function render({ model, el }) {
  // JupyterLab takes keys before the page does, but for elements with this attribute.
  const box = element("div", "ux-widget", el, { "data-lm-suppress-shortcuts": "true" });
  const [width, height] = model.get("_size");
  box.style.maxWidth = `${Math.max(width, 320)}px`;
  const label = "Volume. Arrow keys turn it, with Shift the light; plus and minus zoom; Home resets the view.";
  const stage = element("div", "ux-stage", box, { tabindex: 0, role: "application", "aria-label": label });
  stage.style.aspectRatio = `${width} / ${height}`;
  const image = element("img", "ux-picture", stage, { alt: "Rendered volume", draggable: "false" });
  const view = new View(model);
  const drawDisc = lightDisc(stage, view);
  const error = element("div", "ux-error", stage, { role: "alert" });
  const status = element("div", "ux-status", stage);
  element("div", "ux-foot", box).textContent = "Drag: turn · Shift + drag: light · Wheel or two fingers: zoom";

  const show = () => {
    const bytes = model.get("_picture");
    // The browser frees the former picture.
    URL.revokeObjectURL(image.src);
    if (bytes?.byteLength) image.src = URL.createObjectURL(new Blob([bytes], { type: "image/png" }));
  };
  const showError = () => {
    error.textContent = model.get("_error");
    error.hidden = !error.textContent;
  };
  pointerControls(stage, view);
  keyControls(stage, view);
  const editor = new Opacity(box, view);
  const showStatus = () => {
    const { sent, latency, state } = view;
    stage.setAttribute("aria-busy", String(Boolean(sent)));
    const angles = `${Math.round(state.azimuth_deg)}°, ${Math.round(state.elevation_deg)}°`;
    const time = sent && !sent.drag ? "drawing" : latency ? `${Math.round(latency)} ms` : "";
    status.textContent = [angles, time].filter(Boolean).join(" · ");
  };
  view.listeners.push(drawDisc, showStatus, () => editor.draw());

  const listeners = { "change:_picture": show, "change:_error": showError, "change:_answer": () => view.answered() };
  for (const name of STATE) listeners[`change:${name}`] = () => view.adopt();
  for (const [name, listener] of Object.entries(listeners)) model.on(name, listener);
  showError();
  show();
  view.ask(false);
  return () => {
    for (const [name, listener] of Object.entries(listeners)) model.off(name, listener);
    clearTimeout(view.rest);
    URL.revokeObjectURL(image.src);
  };
}

export default { render };
