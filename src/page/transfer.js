"use strict";
// Lookup tables of an edited transfer function, and the bricks with extinction under it: the same numbers as those of
// src/transfer/tables.rs, src/transfer/pairs.rs and src/field/active_bricks.rs.

// Number of elements at the begin of a list for which a condition holds.
function partitionPoint(list, holds) {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (holds(list[middle])) low = middle + 1; else high = middle;
  }
  return low;
}

// Next larger number in 64 bits, and next smaller one in 32 bits.
function nextUp(x) {
  if (x === 0) return Number.MIN_VALUE;
  const bits = new BigInt64Array(new Float64Array([x]).buffer);
  bits[0] += x > 0 ? 1n : -1n;
  return new Float64Array(bits.buffer)[0];
}
function nextDown32(x) {
  if (x === 0) return -(2 ** -149);
  const bits = new Int32Array(new Float32Array([x]).buffer);
  bits[0] += x > 0 ? -1 : 1;
  return new Float32Array(bits.buffer)[0];
}

// Nodes and weights of Gauss-Legendre quadrature with 4 points.
const GAUSS = [[-0.8611363115940526, 0.34785484513745385], [-0.33998104358485626, 0.6521451548625461],
  [0.33998104358485626, 0.6521451548625461], [0.8611363115940526, 0.34785484513745385]];
// Relative error up to which a point counts as lying on the line between its neighbours.
const REDUNDANT = 1e-8;
// Share of a bin by which rounding may move a value into the next bin.
const BIN_ROUNDING = 1e-3;
const NO_NODE = 0xffff;

// Transfer function with points { value, amount, color }, rising in value, whose extinction is multiplied by a factor.
class TransferFunction {
  constructor(record, points, factor) {
    Object.assign(this, record);
    this.isOpacity = record.quantity === "opacity";
    this.reference_length_mm /= factor;
    this.points = this.isOpacity ? points : points.map((p) => ({ ...p, amount: factor * p.amount }));
    this.texels = this.points.map(({ value }) => (value - this.offset) / this.scale);
    this.intervals = this.merged(this.linearIntervals());
    this.breaks = this.intervals.slice(1).map(({ start }) => start);
  }

  extinctionOf(amount) {
    return this.isOpacity ? -Math.log1p(-Math.min(amount, this.max_opacity)) / this.reference_length_mm : amount;
  }

  // Amount and colour at a value.
  at(value) {
    const after = partitionPoint(this.points, (p) => p.value <= value);
    const [a, b] = [this.points[Math.max(after - 1, 0)], this.points[Math.min(after, this.points.length - 1)]];
    const w = a.value < b.value && after > 0 ? (value - a.value) / (b.value - a.value) : 0;
    const mix = (x, y) => x + (y - x) * w;
    return { amount: mix(a.amount, b.amount), color: a.color.map((c, i) => mix(c, b.color[i])) };
  }

  linearIntervals() {
    const { points, texels } = this;
    const last = points.length - 1;
    const list = [{ start: texels[0], end: texels[0], amount: points[0].amount, slope: 0 }];
    for (let i = 0; i < last; i++) {
      const [start, end] = [texels[i], texels[i + 1]];
      const rise = points[i + 1].amount - points[i].amount;
      if (Math.fround(end) > Math.fround(start)) list.push({ start, end, amount: points[i].amount, slope: rise / (end - start) });
    }
    return [...list, { start: texels[last], end: this.far, amount: points[last].amount, slope: 0 }];
  }

  // Merges neighbouring intervals on one line.
  merged(list) {
    const atEnd = ({ start, end, amount, slope }) => amount + slope * (end - start);
    const isSmall = (error, amount) => Math.abs(error) <= REDUNDANT * Math.min(amount, Math.abs(1 - amount));
    const merged = [];
    let inside = [];
    for (const next of list) {
      const last = merged.at(-1);
      const slope = last && next.end < this.far ? (atEnd(next) - last.amount) / (next.end - last.start) : 0;
      const isOnLine = ([at, amount]) => isSmall(last.amount + slope * (at - last.start) - amount, amount);
      const here = [next.start, next.amount];
      if (last && (merged.length > 1 || slope === 0) && isSmall(atEnd(last) - next.amount, next.amount)
        && [here, ...inside].every(isOnLine)) {
        inside.push(here);
        Object.assign(last, { slope, end: next.end });
      } else {
        inside = [];
        merged.push({ ...next });
      }
    }
    return merged;
  }

  // Start and width of the bins of texel values.
  binned() {
    const [first, last] = [this.breaks[0] ?? 0, this.breaks.at(-1) ?? 0];
    return [first, last > first ? (last - first) * (1 + 1e-6) : 1];
  }

  // Contents of the buffer of intervals: start, amount, slope and 1 - amount of each, then the interval of each bin.
  intervalTable() {
    const words = new Uint32Array(4 * this.max_intervals + this.value_bins);
    const floats = new Float32Array(words.buffer);
    this.intervals.forEach(({ start, amount, slope }, i) => floats.set([start, amount, slope, 1 - amount], 4 * i));
    const [first, width] = this.binned();
    for (let bin = 0; bin < this.value_bins; bin++) {
      const edge = first + (bin - 1e-3) * (width / this.value_bins);
      words[4 * this.max_intervals + bin] = partitionPoint(this.breaks, (start) => start <= edge);
    }
    return words;
  }

  // Texels of the two tables of integrals over the texel value: of extinction and its product with the colour up to each edge
  // of a bin, and of the extinction in each bin.
  integralTables() {
    const { table_bins, table_origin, table_width } = this;
    const integrals = new Float32Array(4 * (table_bins + 1));
    const extinction = new Float32Array(4 * table_bins);
    const total = [0, 0, 0, 0];
    const edge = (i) => table_origin + (table_width * i) / table_bins;
    for (let bin = 0; bin < table_bins; bin++) {
      const [a, b] = [edge(bin), edge(bin + 1)];
      const sum = [0, 0, 0, 0];
      let from = a;
      for (const to of [...this.breaks.filter((start) => start > a && start < b), b]) {
        const [middle, half] = [0.5 * (from + to), 0.5 * (to - from)];
        for (const [x, weight] of GAUSS) {
          const { amount, color } = this.at((middle + half * x) * this.scale + this.offset);
          const sigma = this.extinctionOf(amount) * weight * half;
          color.forEach((c, i) => { sum[i] += sigma * c; });
          sum[3] += sigma;
        }
        from = to;
      }
      const before = Math.fround(total[3]);
      extinction.set([before, total[3] - before, sum[3], 0], 4 * bin);
      sum.forEach((part, i) => { total[i] += part; });
      integrals.set(total, 4 * (bin + 1));
    }
    return { integrals, extinction };
  }

  // Texels of the table of breakpoints between two values.
  pairTable() {
    const { breaks, pair_bins } = this;
    const [origin, width] = this.binned();
    const edges = Array.from({ length: pair_bins }, (_, bin) => [
      bin === 0 ? 0 : partitionPoint(breaks, (s) => s < origin + (bin - BIN_ROUNDING) * (width / pair_bins)),
      bin + 1 === pair_bins ? breaks.length
        : partitionPoint(breaks, (s) => s <= origin + (bin + 1 + BIN_ROUNDING) * (width / pair_bins)),
    ]);
    const nodes = new Uint16Array(4 * pair_bins ** 2).fill(NO_NODE);
    for (let from = 0; from < pair_bins; from++) {
      for (let to = 0; to < pair_bins; to++) {
        const at = 4 * (from * pair_bins + to);
        const first = edges[Math.min(from, to)][0];
        const count = edges[Math.max(from, to)][1] - first;
        if (count > 4 || (from === to && count > 1)) nodes[at + 3] = this.more_nodes;
        else for (let i = 0; i < count; i++) nodes[at + (from > to ? count - 1 - i : i)] = first + i + 1;
      }
    }
    return nodes;
  }

  // Texel values at and below which, and at and above which, there is no extinction.
  extinctionRange() {
    const texels = this.texels.map(Math.fround);
    const first = this.points.findIndex(({ amount }) => amount > 0);
    const last = this.points.findLastIndex(({ amount }) => amount > 0);
    if (first < 0) return [this.far, -this.far];
    return [
      first === 0 ? -this.far : texels[first - 1] < texels[first] ? texels[first - 1] : nextDown32(texels[first]),
      last === texels.length - 1 ? this.far : texels[last + 1],
    ];
  }

  // Intervals of values with extinction. Each grows into the gap to the next one, since the tables blur the function.
  extinctionIntervals() {
    const list = [];
    const add = (low, high) => {
      const last = list.at(-1);
      if (low > high) return;
      if (last && low <= nextUp(last[1])) last[1] = Math.max(last[1], high); else list.push([low, high]);
    };
    this.points.forEach((a, i) => {
      const b = this.points[i + 1];
      if (a.amount > 0) add(i > 0 ? a.value : -Infinity, b ? a.value : Infinity);
      if (b && (a.amount > 0 || b.amount > 0)) add(nextUp(a.value), -nextUp(-b.value));
    });
    const blur = this.scale / Math.fround(this.table_bins / this.table_width);
    list.slice(1).forEach((interval, i) => { list[i][1] += blur; interval[0] -= blur; });
    return list;
  }
}

// Bricks (blocks of cells) with extinction: `minima` and `maxima` are the values in each brick, x fastest. Returns the
// Chebyshev distance of each brick to the nearest active one, the active bricks at the surface as x, y and z, and the corners of
// the active bricks in grid space, of which the first and last of each row are enough.
function activeBricks(intervals, minima, maxima, [nx, ny, nz], { dims, brick_cells }) {
  // One more brick on all sides.
  const [row, slice] = [nx + 2, (nx + 2) * (ny + 2)];
  const padded = new Uint8Array(slice * (nz + 2)).fill(255);
  const place = (x, y, z) => (z + 1) * slice + (y + 1) * row + x + 1;
  const places = new Uint32Array(nx * ny * nz);
  for (let z = 0, brick = 0; z < nz; z++) {
    for (let y = 0; y < ny; y++) for (let x = 0; x < nx; x++) places[brick++] = place(x, y, z);
  }
  for (const [low, high] of intervals) {
    places.forEach((at, brick) => { if (low <= maxima[brick] && high >= minima[brick]) padded[at] = 0; });
  }
  const [outer, corners] = [[], []];
  const ends = (axis, first, last) => [Math.max(brick_cells * first, 0.5), Math.min(brick_cells * (last + 1), dims[axis] + 0.5)];
  for (let z = 0; z < nz; z++) {
    for (let y = 0; y < ny; y++) {
      const line = padded.subarray(place(0, y, z), place(nx, y, z));
      const xs = ends(0, line.indexOf(0), line.lastIndexOf(0));
      if (!line.includes(0)) continue;
      for (const cx of xs) for (const cy of ends(1, y, y)) for (const cz of ends(2, z, z)) corners.push([cx, cy, cz]);
      line.forEach((distance, x) => {
        const at = place(x, y, z);
        const isOuter = [1, row, slice].some((step) => padded[at - step] || padded[at + step]);
        if (distance === 0 && isOuter) outer.push([x, y, z]);
      });
    }
  }
  // Two sweeps over all bricks (Rosenfeld and Pfaltz 1966).
  const steps = [-1, 0, 1].flatMap((z) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((x) => z * slice + y * row + x)));
  for (const back of [steps.filter((step) => step < 0), steps.filter((step) => step > 0)]) {
    for (const at of places) {
      let least = padded[at];
      for (let i = 0; i < 13 && least > 0; i++) least = Math.min(least, padded[at + back[i]] + 1);
      padded[at] = least;
    }
    places.reverse();
  }
  return { distance: new Uint8Array(places.length).map((_, brick) => padded[places[brick]]), outer, corners };
}
