"use strict";
// Editor of the points of the transfer function: values to the right, opacity or extinction upwards on a square-root axis.

const SVG = "http://www.w3.org/2000/svg";
const [CURVE_WIDTH, CURVE_HEIGHT, CURVE_MARGIN] = [480, 160, 8];
const MOST_POINTS = 64;
// Smallest distance of two points, as a share of the range of values.
const LEAST_GAP = 1e-6;

const encoded = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
const decoded = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
const codes = (color) => color.map((c) => Math.round(255 * encoded(Math.min(Math.max(c, 0), 1))));
const hex = (color) => `#${codes(color).map((code) => code.toString(16).padStart(2, "0")).join("")}`;

class FunctionEditor {
  // `page` has `points`, which are drawn, and `setPoints`, which changes them.
  constructor(record, page) {
    Object.assign(this, { record, page, svg: document.getElementById("curve") });
    const { points, range, quantity, units, reference_length_mm } = record;
    const values = points.map(({ value }) => value);
    this.low = Math.min(range[0], ...values);
    this.width = Math.max(range[1], ...values) - this.low || 1;
    this.top = quantity === "opacity" ? 1 : 1.5 * Math.max(...points.map(({ amount }) => amount));
    const amount = quantity === "opacity" ? `opacity per ${reference_length_mm} mm` : "extinction in 1/mm";
    document.getElementById("axes").textContent = `${this.low} to ${this.low + this.width} ${units}, ${amount} from 0 to ` +
      `${this.top.toPrecision(3)} (square-root axis)`;
    document.getElementById("function").hidden = false;
    this.svg.setAttribute("viewBox", `0 0 ${CURVE_WIDTH} ${CURVE_HEIGHT}`);
    this.listen();
  }

  get points() { return this.page.points; }

  place({ value, amount }) {
    const [w, h] = [CURVE_WIDTH - 2 * CURVE_MARGIN, CURVE_HEIGHT - 2 * CURVE_MARGIN];
    const up = Math.sqrt(Math.min(amount / this.top, 1));
    return [CURVE_MARGIN + (w * (value - this.low)) / this.width, CURVE_MARGIN + h * (1 - up)];
  }

  // Value and amount at the position of an event.
  at({ clientX, clientY }) {
    const box = this.svg.getBoundingClientRect();
    const scale = CURVE_WIDTH / box.width;
    const x = (scale * (clientX - box.left) - CURVE_MARGIN) / (CURVE_WIDTH - 2 * CURVE_MARGIN);
    const y = (scale * (clientY - box.top) - CURVE_MARGIN) / (CURVE_HEIGHT - 2 * CURVE_MARGIN);
    const inside = (share) => Math.min(Math.max(share, 0), 1);
    return { value: this.low + this.width * inside(x), amount: this.top * inside(1 - y) ** 2 };
  }

  listen() {
    const indexOf = ({ target }) => Number(target.dataset.index ?? -1);
    let dragged = -1;
    this.svg.addEventListener("pointerdown", (event) => {
      if (event.button === 0) dragged = indexOf(event);
    });
    addEventListener("pointermove", (event) => {
      if (dragged >= 0) this.move(dragged, this.at(event));
    });
    ["pointerup", "pointercancel"].forEach((type) => addEventListener(type, () => { dragged = -1; }));
    this.svg.addEventListener("dblclick", (event) => {
      if (indexOf(event) < 0) this.add(this.at(event));
    });
    this.svg.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      this.remove(indexOf(event));
    });
    this.svg.addEventListener("keydown", (event) => {
      if (event.key === "Delete" || event.key === "Backspace") this.remove(indexOf(event));
    });
    document.getElementById("save").addEventListener("click", () => {
      const href = URL.createObjectURL(new Blob([this.text()], { type: "application/json" }));
      Object.assign(document.createElement("a"), { href, download: "function.json" }).click();
      URL.revokeObjectURL(href);
    });
  }

  edit(points) {
    this.page.setPoints(points);
    this.show();
  }

  // Moves a point. It stays between its neighbours.
  move(index, { value, amount }) {
    const gap = LEAST_GAP * this.width;
    const [before, after] = [this.points[index - 1], this.points[index + 1]].map((point) => point?.value);
    const limited = Math.max(Math.min(value, after === undefined ? value : after - gap), before === undefined ? -Infinity : before + gap);
    this.edit(this.points.with(index, { ...this.points[index], value: limited, amount }));
  }

  // Adds a point with the colour that the function has there, as a file stores it.
  add({ value, amount }) {
    const gap = LEAST_GAP * this.width;
    if (this.points.length >= MOST_POINTS || this.points.some((point) => Math.abs(point.value - value) < gap)) return;
    const { color } = new TransferFunction(this.record, this.points, 1).at(value);
    const point = { value, amount, color: codes(color).map((code) => decoded(code / 255)) };
    this.edit([...this.points, point].sort((a, b) => a.value - b.value));
  }

  remove(index) {
    if (index >= 0 && this.points.length > 1) this.edit(this.points.toSpliced(index, 1));
  }

  show() {
    const { points } = this;
    const element = (name, attributes) => {
      const made = document.createElementNS(SVG, name);
      Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
      return made;
    };
    const { counts, range } = this.record.histogram;
    const highest = Math.sqrt(Math.max(...counts, 1));
    const bars = counts.map((count, i) => {
      const value = range[0] + ((range[1] - range[0]) * (i + 0.5)) / counts.length;
      return this.place({ value, amount: this.top * (Math.sqrt(count) / highest) ** 2 }).join();
    });
    const ends = [{ ...points[0], value: this.low }, ...points, { ...points.at(-1), value: this.low + this.width }];
    const focused = this.svg.querySelector(":focus")?.dataset.index;
    const circles = points.map((point, i) => {
      const [cx, cy] = this.place(point);
      const circle = element("circle", { cx, cy, r: 6, fill: hex(point.color), tabindex: 0, "data-index": i });
      circle.append(element("title", {}));
      circle.firstChild.textContent = `${point.value.toPrecision(5)}: ${point.amount.toPrecision(3)}`;
      return circle;
    });
    const line = element("polyline", { points: ends.map((point) => this.place(point).join()).join(" ") });
    this.svg.replaceChildren(element("polyline", { class: "histogram", points: bars.join(" ") }), line, ...circles);
    circles[focused]?.focus();
  }

  // Text of a transfer-function file of this program with the present function.
  text() {
    const { name, units, quantity, reference_length_mm } = this.record;
    const [amounts, lengths] = quantity === "opacity" ? [1, this.page.extinction] : [this.page.extinction, 1];
    const points = this.points.map(({ value, amount, color }) => ({ value, [quantity]: amounts * amount, color: hex(color) }));
    return JSON.stringify({ name, units, reference_length_mm: reference_length_mm / lengths, points }, undefined, 2);
  }
}
