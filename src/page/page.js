"use strict";
// Draws the scene of the page with WebGPU: creates the resources, writes the uniforms of camera and light, and runs
// the passes of src/render/portable.rs. All shaders are those of the program.

// Vectors are arrays of numbers. An affine transform is 12 numbers, column by column.
const add = (a, b) => a.map((x, i) => x + b[i]);
const scaled = (a, factor) => a.map((x) => factor * x);
const sub = (a, b) => add(a, scaled(b, -1));
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (a) => scaled(a, 1 / Math.hypot(...a));
const column = (affine, i) => affine.slice(3 * i, 3 * i + 3);
const transformVector = (affine, v) => [0, 1, 2].reduce((sum, i) => add(sum, scaled(column(affine, i), v[i])), [0, 0, 0]);
const transformPoint = (affine, p) => add(transformVector(affine, p), column(affine, 3));
// Rotates v about a unit axis.
const rotate = (v, axis, angle) => add(add(scaled(v, Math.cos(angle)), scaled(cross(axis, v), Math.sin(angle))),
  scaled(axis, dot(axis, v) * (1 - Math.cos(angle))));

function axesOf({ eye, target, up }) {
  const forward = unit(sub(target, eye));
  const right = unit(cross(forward, up));
  return { right, up: cross(right, forward), forward };
}

// Unit vector across a unit vector (Duff et al. 2017), as the program chooses the first axis of a shadow map.
function orthonormal([x, y, z]) {
  const sign = z < 0 || Object.is(z, -0) ? -1 : 1;
  const a = -1 / (sign + z);
  return [x * y * a, sign + y * y * a, -y];
}

// Error of a shadow map that is larger than its memory.
class TooLarge extends Error {}

// Uniform whose members are written by name.
class Uniform {
  constructor({ size, offsets }, bytes) {
    this.bytes = new Uint8Array(size);
    this.bytes.set(bytes.slice(0, size));
    this.view = new DataView(this.bytes.buffer);
    this.offsets = offsets;
  }
  floats(name, ...values) {
    values.flat().forEach((x, i) => this.view.setFloat32(this.offsets[name] + 4 * i, x, true));
  }
  words(name, ...values) {
    values.flat().forEach((x, i) => this.view.setUint32(this.offsets[name] + 4 * i, x, true));
  }
}

// Unpacks the data of the page: a record, and the bytes of its resources.
async function unpack() {
  const text = atob(document.getElementById("data").textContent);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const all = await new Response(stream).arrayBuffer();
  const length = new DataView(all).getUint32(0, true);
  const record = JSON.parse(new TextDecoder().decode(new Uint8Array(all, 4, length)));
  return { record, bytes: new Uint8Array(all, 4 + length) };
}

const NEEDS = "This page needs WebGPU (Chrome or Edge 121, Safari 26, Firefox 141, or later).";

// Throws an error if the browser has no WebGPU, or hides it from this page.
function checkBrowser() {
  if (navigator.gpu) return;
  throw new Error(isSecureContext ? `${NEEDS} This browser has none.`
    : "Browsers offer WebGPU to https pages, localhost and local files only. Save this page as a file and open the file.");
}

async function openDevice({ contents }) {
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
  if (!adapter) throw new Error(`${NEEDS} It finds no graphics adapter here.`);
  const requiredFeatures = contents.filters_float32 ? ["float32-filterable"] : [];
  const missing = requiredFeatures.filter((name) => !adapter.features.has(name));
  if (missing.length) throw new Error(`This graphics adapter lacks ${missing}.`);
  checkLimits(contents.resources, adapter.limits);
  const { maxBufferSize, maxStorageBufferBindingSize, maxTextureDimension2D, maxTextureDimension3D } = adapter.limits;
  const requiredLimits = { maxBufferSize, maxStorageBufferBindingSize, maxTextureDimension2D, maxTextureDimension3D };
  return adapter.requestDevice({ requiredFeatures, requiredLimits });
}

// Throws an error if a resource is larger than the adapter allows.
function checkLimits(resources, limits) {
  for (const { kind, size, dimension } of resources) {
    const most = kind === "buffer" ? Math.min(limits.maxBufferSize, limits.maxStorageBufferBindingSize)
      : dimension === "3d" ? limits.maxTextureDimension3D : limits.maxTextureDimension2D;
    const largest = Math.max(...[size ?? 0].flat());
    if (largest > most) throw new Error(`A ${kind} of ${size} exceeds the limit ${most} of this graphics adapter.`);
  }
}

// Resources of the page on a device, and the passes of its pictures.
class Renderer {
  constructor(device, record, bytes) {
    Object.assign(this, { device, record, bytes });
    const { contents } = record;
    this.layouts = contents.layouts.map((entries) => device.createBindGroupLayout({
      entries: entries.map((entry) => ({ ...entry, visibility: GPUShaderStage.COMPUTE })),
    }));
    this.resources = contents.resources.map((resource) => this.create(resource));
    this.pipelines = new Map();
    // Methods whose shadow maps are those of another light or transfer function.
    this.outdated = new Set();
    // Bricks with extinction: corners in grid space, and with an edited function also distances and those at the surface.
    this.active = { box: record.space.active, hull: record.space.hull };
    // Rows of tiles in a submission; follows the speed of the device.
    this.band = 8;
  }

  contentsOf({ at, size, bytes_per_row }) {
    const length = bytes_per_row ? bytes_per_row * size[1] * size[2] : size;
    return at === null ? new Uint8Array(length) : this.bytes.subarray(at, at + length);
  }

  create(resource) {
    const { kind, size, format, dimension, bytes_per_row, filter, stored } = resource;
    if (kind === "sampler") return { sampler: this.device.createSampler({ magFilter: filter, minFilter: filter }) };
    if (kind === "buffer") {
      const buffer = this.buffer(size);
      if (resource.at !== null) this.device.queue.writeBuffer(buffer, 0, this.contentsOf(resource));
      return { buffer };
    }
    const { TEXTURE_BINDING, STORAGE_BINDING, COPY_DST } = GPUTextureUsage;
    const usage = TEXTURE_BINDING | COPY_DST | (stored ? STORAGE_BINDING : 0);
    const texture = this.device.createTexture({ size, format, dimension, usage });
    // New textures hold zeros.
    if (resource.at === null) return { texture, view: texture.createView() };
    const layout = { bytesPerRow: bytes_per_row, rowsPerImage: size[1] };
    this.device.queue.writeTexture({ texture }, this.contentsOf(resource), layout, size);
    return { texture, view: texture.createView() };
  }

  buffer(size) {
    const { UNIFORM, STORAGE, COPY_DST, COPY_SRC } = GPUBufferUsage;
    return this.device.createBuffer({ size: Math.max(size, 16), usage: UNIFORM | STORAGE | COPY_DST | COPY_SRC });
  }

  // Returns a bind group of the page, in which some bindings are replaced.
  bind(index, replaced = []) {
    const { layout, entries } = this.record.contents.groups[index];
    const resource = ([binding, at]) => {
      const { buffer, view, sampler } = this.resources[at];
      return sampler ?? view ?? { buffer: replaced[binding] ?? buffer };
    };
    return this.device.createBindGroup({
      layout: this.layouts[layout],
      entries: entries.map((entry) => ({ binding: entry[0], resource: resource(entry) })),
    });
  }

  // Returns a resource of a bind group of the page, with its record and its initial contents.
  bound(index, binding) {
    const { contents } = this.record;
    const [, at] = contents.groups[index].entries.find(([number]) => number === binding);
    const record = contents.resources[at];
    return { ...this.resources[at], record, bytes: this.contentsOf(record) };
  }

  pipeline(index) {
    const { shaders, pipelines } = this.record.contents;
    const { shader, layouts } = pipelines[index];
    if (!this.pipelines.has(index)) {
      const layout = this.device.createPipelineLayout({ bindGroupLayouts: layouts.map((i) => this.layouts[i]) });
      const module = this.device.createShaderModule({ code: shaders[shader] });
      this.pipelines.set(index, this.device.createComputePipelineAsync({ layout, compute: { module } }));
    }
    return this.pipelines.get(index);
  }

  // Buffers of a picture of the given size.
  target(size) {
    const tiles = size.map((n) => Math.ceil(n / this.record.picture_side));
    const start = new Float32Array(4 * size[0] * size[1] + 4).fill(this.record.not_started);
    start.fill(0, 0, 4);
    return {
      size, tiles, start,
      picture: this.buffer(16 * size[0] * size[1]),
      progress: this.buffer(start.byteLength),
      depths: this.buffer(16 + 8 * tiles[0] * tiles[1]),
      frame: this.buffer(this.record.uniforms.frame.size),
      projection: this.buffer(this.record.uniforms.projection.size),
    };
  }

  frame(pass, { eye, target, up, fov_deg }, { size }) {
    const { space, uniforms } = this.record;
    const axes = axesOf({ eye, target, up });
    const distance = this.planeDistance(eye, axes);
    const tan = Math.tan((0.5 * fov_deg * Math.PI) / 180);
    const frame = new Uniform(uniforms.frame, Uint8Array.from(pass.frame));
    frame.floats("plane_center", transformPoint(space.grid_from_world, add(eye, scaled(axes.forward, distance))));
    frame.floats("plane_distance_mm", distance);
    frame.floats("grid_forward", transformVector(space.grid_from_world, axes.forward));
    frame.floats("grid_right", transformVector(space.grid_from_world, axes.right));
    frame.floats("grid_up", transformVector(space.grid_from_world, axes.up));
    frame.floats("half_extent", (size[0] / size[1]) * tan, tan);
    frame.words("size", size);
    frame.words("rows", size[1]);
    return frame;
  }

  // Distance from the eye to the plane across the view through the middle of the volume, mm.
  planeDistance(eye, { forward }) {
    const { volume_center, min_spacing_mm } = this.record.space;
    return Math.max(dot(sub(volume_center, eye), forward), min_spacing_mm);
  }

  projection(group, camera, { size, tiles }) {
    const { space, uniforms } = this.record;
    const axes = axesOf(camera);
    const toCamera = (v) => [dot(axes.right, v), dot(axes.up, v), dot(axes.forward, v)];
    const distance = this.planeDistance(camera.eye, axes);
    const half = [0, 1, 2].map(() => 0.5 * space.brick_cells);
    const first = toCamera(sub(transformPoint(space.world_from_grid, half), camera.eye));
    const scale = 0.5 / Math.tan((0.5 * camera.fov_deg * Math.PI) / 180);
    const projection = new Uniform(uniforms.projection, this.bound(group, 0).bytes);
    ["brick_x", "brick_y", "brick_z"].forEach((name, i) => {
      projection.floats(name, scaled(toCamera(column(space.world_from_grid, i)), space.brick_cells));
    });
    projection.floats("plane_distance_mm", distance);
    projection.floats("first_center", first[0], first[1], first[2] - distance);
    projection.words("inside", this.isInside(camera.eye) ? 1 : 0);
    projection.floats("pixels_per_tangent", size[1] * scale, size[1] * scale);
    projection.floats("size", size);
    projection.words("tiles", tiles);
    if (this.active.outer) projection.words("bricks", this.active.outer.count);
    return projection;
  }

  // Whether a point lies in an active brick or next to one.
  isInside(point) {
    const { space, methods } = this.record;
    const { record, bytes } = this.bound(methods[0].field, 3);
    const brick = transformPoint(space.grid_from_world, point).map((x) => Math.floor(x / space.brick_cells));
    if (brick.some((x, i) => x < 0 || x >= record.size[i])) return false;
    const distance = this.active.distance ?? bytes;
    return distance[(brick[2] * record.size[1] + brick[1]) * record.size[0] + brick[0]] <= 1;
  }

  // Sets the direction to a directional light (undefined: the light stays), the factor of extinction, and the points of the
  // transfer function (undefined: the initial ones). Methods with shadow maps then build them again.
  setScene(number, toward, extinction, points = this.record.function?.points) {
    const { lights, methods } = this.record;
    const [tables, scene] = [JSON.stringify([extinction, points]), JSON.stringify([extinction, points, toward])];
    if (scene === this.scene) return;
    if (this.scene !== undefined) {
      if (tables !== this.tables) points ? this.setFunction(points, extinction) : this.scaleExtinction(extinction);
      lights.map((initial, i) => (i === number && toward) || initial).forEach((to, i) => to && this.moveLight(i, to));
      this.outdated = new Set(methods.filter(({ builds }) => builds.length > 0));
    }
    Object.assign(this, { tables, scene });
  }

  // Writes the projections of a directional light; `toward` points to the light.
  moveLight(number, toward) {
    const { space, uniforms, methods } = this.record;
    if (!uniforms.light) return;
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
      transformPoint(space.world_from_grid, [0, 1, 2].map((axis) => this.active.box[(i >> axis) & 1][axis])));
    const center = scaled(corners.reduce(add), 1 / 8);
    const h = scaled(unit(toward), -1);
    const a = orthonormal(h);
    const b = cross(h, a);
    const depths = corners.map((corner) => dot(h, sub(corner, center)));
    const range = Math.max(Math.max(...depths) - Math.min(...depths), 1e-9);
    const origin = sub(column(space.world_from_grid, 3), center);
    for (const { follows_light, passes, builds } of methods) {
      if (!follows_light || !passes[number]) continue;
      const { buffer, bytes } = this.bound(passes[number].shadow, 0);
      const light = new Uniform(uniforms.light, bytes);
      const build = builds[number];
      if (build) {
        this.scaleLengths(build, range / light.view.getFloat32(light.offsets.depth_range_mm, true));
        this.layOut(light, [a, b], center);
      }
      [["a", a], ["b", b], ["h", h]].forEach(([name, axis]) => {
        const row = [0, 1, 2].map((i) => dot(axis, column(space.world_from_grid, i)));
        light.floats(`frame_from_grid_${name}`, row, dot(axis, origin));
        light.floats(`grid_per_${name}`, transformVector(space.grid_from_world, axis));
      });
      light.floats("grid_origin", transformPoint(space.grid_from_world, center));
      light.floats("depth_start_mm", Math.min(...depths));
      light.floats("depth_range_mm", range);
      this.device.queue.writeBuffer(buffer, 0, light.bytes);
    }
  }

  // Lays the texels of a shadow map over the active bricks, with a border of one texel.
  layOut(light, axes, center) {
    const { world_from_grid } = this.record.space;
    const points = this.active.hull.map((corner) => sub(transformPoint(world_from_grid, corner), center));
    const side = light.view.getUint32(light.offsets.map_size, true);
    const border = side < 8 ? 0 : 1;
    const layouts = axes.map((axis) => {
      const places = points.map((point) => dot(axis, point));
      const low = places.reduce((least, x) => Math.min(least, x));
      const scale = (side - 2 * border) / Math.max(places.reduce((most, x) => Math.max(most, x)) - low, 1e-9);
      return { scale, offset: border - 0.5 - low * scale };
    });
    light.floats("texel_scale", layouts.map(({ scale }) => scale));
    light.floats("texel_offset", layouts.map(({ offset }) => offset));
    light.floats("texel_mm", Math.max(...layouts.map(({ scale }) => 1 / scale)));
  }

  // Multiplies the initial lengths of a build that depend on the depth range of its map.
  scaleLengths({ lengths }, factor) {
    for (const { resource, offset, power } of lengths) {
      const initial = this.contentsOf(this.record.contents.resources[resource]);
      const length = new DataView(initial.buffer, initial.byteOffset).getFloat32(offset, true) * factor ** power;
      this.device.queue.writeBuffer(this.resources[resource].buffer, offset, new Float32Array([length]));
    }
  }

  // Fills a buffer or a texture with zeros; new textures hold them.
  clear(index, encoder) {
    const { buffer, texture } = this.resources[index];
    if (buffer) {
      encoder.clearBuffer(buffer);
    } else {
      texture.destroy();
      this.resources[index] = this.create({ ...this.record.contents.resources[index], at: null });
    }
  }

  // Builds the shadow maps of a method for the present light and extinction, unless they are.
  async build(method) {
    if (!this.outdated.has(method)) return;
    for (const { passes, cleared, limit } of method.builds) {
      const encoder = this.device.createCommandEncoder();
      cleared.forEach((i) => this.clear(i, encoder));
      this.device.queue.submit([encoder.finish()]);
      for (const { pipeline, groups, workgroups } of passes) {
        this.run([{ pipeline: await this.pipeline(pipeline), groups: groups.map((i) => this.bind(i)), workgroups }]);
        await this.device.queue.onSubmittedWorkDone();
      }
      if (!limit) continue;
      const words = Math.max(...limit.missing, limit.needed) + 1;
      const counters = new Uint32Array(await this.read(this.resources[limit.resource].buffer, 4 * words));
      if (limit.missing.some((i) => counters[i] > 0) || counters[limit.needed] > limit.most) {
        throw new TooLarge(`The map of ${method.label} does not fit into its memory for this light and transfer function.`);
      }
    }
    this.outdated.delete(method);
  }

  // Replaces the contents of a resource of bind group 0.
  write(binding, data) {
    const { buffer, texture, record: { size, bytes_per_row } } = this.bound(this.record.methods[0].field, binding);
    const { queue } = this.device;
    if (buffer) queue.writeBuffer(buffer, 0, data);
    else queue.writeTexture({ texture }, data, { bytesPerRow: bytes_per_row, rowsPerImage: size[1] }, size);
  }

  // Writes the lookup tables of the transfer function with other points and a factor on its extinction, and finds the bricks
  // with extinction again.
  setFunction(points, factor) {
    const { methods, uniforms, space, function: initial } = this.record;
    const [field, distances, colors] = [0, 3, 5].map((binding) => this.bound(methods[0].field, binding));
    const tables = new TransferFunction(initial, points, factor);
    const count = distances.record.size.reduce((product, n) => product * n);
    const ranges = this.contentsOf({ at: initial.brick_ranges, size: 16 * count });
    const values = new Float64Array(ranges.buffer, ranges.byteOffset, 2 * count);
    const bricks = activeBricks(tables.extinctionIntervals(), values.subarray(0, count), values.subarray(count), distances.record.size, space);
    this.setActive(bricks);
    const uniform = new Uniform(uniforms.field, field.bytes);
    const [origin, width] = tables.binned();
    const [first, last] = tables.extinctionRange();
    uniform.words("intervals", tables.intervals.length);
    uniform.floats("first_value", first);
    uniform.floats("last_value", last);
    uniform.floats("bin_origin", origin);
    uniform.floats("bins_per_value", initial.value_bins / width);
    if (tables.isOpacity) uniform.floats("inv_reference_length", 1 / tables.reference_length_mm);
    const box = bricks.corners.length ? this.active.box : [[0, 0, 0], [0, 0, 0]];
    ["active_lo", "active_hi"].forEach((name, end) => uniform.floats(name, box[end]));
    const { integrals, extinction } = tables.integralTables();
    this.write(0, uniform.bytes);
    this.write(3, bricks.distance);
    this.write(4, tables.intervalTable());
    // With one colour, the table of its integrals is not read.
    if (colors.record.size[0] > 1) this.write(5, integrals);
    this.write(6, tables.pairTable());
    this.write(8, extinction);
  }

  // Sets the bricks with extinction. Without any, shadow maps stay where they are.
  setActive({ distance, outer, corners }) {
    const extreme = (most) => [0, 1, 2].map((axis) => corners.reduce((x, corner) => most(x, corner[axis]), corners[0][axis]));
    if (corners.length) this.active = { ...this.active, hull: corners, box: [extreme(Math.min), extreme(Math.max)] };
    const groups = Math.ceil(outer.length / this.record.function.line_threads);
    const rows = Math.max(Math.ceil(groups / 65535), 1);
    const buffer = this.buffer(8 * outer.length);
    this.device.queue.writeBuffer(buffer, 0, new Uint32Array(outer.flatMap(([x, y, z]) => [x | (y << 16), z])));
    this.active.outer?.buffer.destroy();
    const workgroups = [Math.ceil(groups / rows), rows, 1];
    this.active = { ...this.active, distance, outer: { buffer, count: outer.length, workgroups } };
  }

  // Multiplies the extinction of a transfer function that cannot be edited, in all lookup tables of bind group 0.
  scaleExtinction(factor) {
    const { methods, uniforms } = this.record;
    const [field, intervals] = [0, 4].map((binding) => this.bound(methods[0].field, binding));
    const uniform = new Uniform(uniforms.field, field.bytes);
    const perLength = uniform.view.getFloat32(uniforms.field.offsets.inv_reference_length, true);
    uniform.floats("inv_reference_length", factor * perLength);
    this.write(0, uniform.bytes);
    if (perLength === 0) {
      // Intervals hold extinction: start value, amount and slope of the amount.
      const amounts = new Float32Array(intervals.bytes.slice().buffer);
      const count = uniform.view.getUint32(uniforms.field.offsets.intervals, true);
      for (let i = 0; i < count; i++) [1, 2].forEach((at) => { amounts[4 * i + at] *= factor; });
      this.write(4, amounts);
    }
    for (const binding of [5, 8]) {
      const { bytes } = this.bound(methods[0].field, binding);
      this.write(binding, new Float32Array(bytes.slice().buffer).map((x) => factor * x));
    }
  }

  // Draws a picture of a method into a target. Ends early, and returns false, when `shouldContinue` does.
  async draw(method, camera, target, shouldContinue = () => true) {
    const { passes, field, stage, mesh } = method;
    await this.build(method);
    const pipelines = await Promise.all([method.background, ...passes.map((p) => p.pipeline)].map((i) => this.pipeline(i)));
    await this.findTiles(method, camera, target);
    const stageGroup = this.bind(stage, [target.frame, target.picture, target.progress, target.depths]);
    for (const [number, pass] of passes.entries()) {
      const groups = [this.bind(field), this.bind(pass.shadow), stageGroup];
      if (mesh !== null) groups.push(this.bind(mesh));
      const frame = this.frame(pass, camera, target);
      if (pass.resumable) this.device.queue.writeBuffer(target.progress, 0, target.start);
      for (let row = 0, rows; row < target.tiles[1]; row += rows) {
        rows = Math.min(this.band, target.tiles[1] - row);
        frame.words("first_tile", 0, row);
        frame.words("part_tiles", target.tiles[0], rows);
        this.device.queue.writeBuffer(target.frame, 0, frame.bytes);
        const fill = number === 0 ? [pipelines[0]] : [];
        if (!(await this.castBand(pass, fill, pipelines[number + 1], groups, target, rows, shouldContinue))) return false;
      }
    }
    return true;
  }

  // Finds the depth ranges of the picture's tiles; without a projection, all tiles have all depths.
  async findTiles({ project }, camera, target) {
    const head = new Uint32Array(4);
    if (!project) {
      const far = new Uint32Array(new Float32Array([this.record.space.far]).buffer)[0];
      head.fill((far | 0x80000000) >>> 0, 2);
    }
    const encoder = this.device.createCommandEncoder();
    encoder.clearBuffer(target.depths);
    this.device.queue.submit([encoder.finish()]);
    this.device.queue.writeBuffer(target.depths, 0, head);
    const { outer } = this.active;
    if (!project || outer?.count === 0) return;
    this.device.queue.writeBuffer(target.projection, 0, this.projection(project.group, camera, target).bytes);
    const groups = [this.bind(project.group, [target.projection, outer?.buffer, target.depths])];
    const { workgroups } = outer ?? project;
    this.run([{ pipeline: await this.pipeline(project.pipeline), groups, workgroups }]);
  }

  // Casts the rays of some rows of tiles, in as many dispatches as they need.
  async castBand({ resumable }, fill, rays, groups, target, rows, shouldContinue) {
    const { block_side } = this.record;
    const blocks = Math.ceil(target.tiles[0] / block_side) * Math.ceil(rows / block_side);
    const count = blocks * block_side * block_side;
    const down = Math.ceil(count / 65535);
    const workgroups = [Math.ceil(count / down), down, 1];
    const began = performance.now();
    let dispatches = 0;
    let pipelines = [...fill, rays];
    do {
      this.run(pipelines.map((pipeline) => ({ pipeline, groups, workgroups })));
      dispatches += 1;
      pipelines = [rays];
      const unfinished = resumable && new Uint32Array(await this.read(target.progress, 4))[0];
      if (!resumable) await this.device.queue.onSubmittedWorkDone();
      if (!shouldContinue()) return false;
      if (!unfinished) break;
      this.device.queue.writeBuffer(target.progress, 0, new Uint32Array(1));
    } while (true);
    const ms = (performance.now() - began) / dispatches;
    if (ms < 40) this.band = Math.min(2 * this.band, 4096);
    if (ms > 160) this.band = Math.max(Math.floor(this.band / 2), 1);
    return true;
  }

  run(passes) {
    const encoder = this.device.createCommandEncoder();
    const compute = encoder.beginComputePass();
    for (const { pipeline, groups, workgroups } of passes) {
      compute.setPipeline(pipeline);
      groups.forEach((group, i) => compute.setBindGroup(i, group));
      compute.dispatchWorkgroups(...workgroups);
    }
    compute.end();
    this.device.queue.submit([encoder.finish()]);
  }

  async read(buffer, size) {
    const usage = GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST;
    const staging = this.device.createBuffer({ size, usage });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(buffer, 0, staging, 0, size);
    this.device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    const bytes = staging.getMappedRange().slice(0);
    staging.destroy();
    return bytes;
  }

  // Returns the pixels of a picture of a method: linear RGB and opacity, row by row from the top.
  async pixels(number, camera = this.record.camera, size = this.record.size) {
    const target = this.target(size);
    await this.draw(this.record.methods[number], camera, target);
    return this.pixelsOf(target);
  }

  async pixelsOf({ picture, size }) {
    return new Float32Array(await this.read(picture, 16 * size[0] * size[1]));
  }
}

// sRGB encoding of linear light in 65536 steps, 8 bits.
const SRGB = Uint8ClampedArray.from({ length: 65536 }, (_, i) => {
  const x = i / 65535;
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
});
const srgb = (linear) => SRGB[Math.round(65535 * Math.min(Math.max(linear, 0), 1))];

// Shows a picture of linear colours on the canvas, or its difference from a reference as black, red, yellow, white.
function show(canvas, size, pixels, reference) {
  [canvas.width, canvas.height] = size;
  const context = canvas.getContext("2d");
  const image = context.createImageData(...size);
  for (let i = 0; i < pixels.length; i += 4) {
    const error = reference && difference(pixels, reference, i) / BRIGHTEST;
    for (let c = 0; c < 3; c++) image.data[i + c] = reference ? 255 * (3 * error - c) : srgb(pixels[i + c]);
    image.data[i + 3] = 255;
  }
  context.putImageData(image, 0, 0);
}

// Largest difference of a colour channel at a pixel.
function difference(a, b, i) {
  return Math.max(Math.abs(a[i] - b[i]), Math.abs(a[i + 1] - b[i + 1]), Math.abs(a[i + 2] - b[i + 2]));
}

// Root of the mean square of the difference of colours, and the largest one.
function errors(a, b) {
  let [sum, largest] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    for (let c = 0; c < 3; c++) sum += (a[i + c] - b[i + c]) ** 2;
    largest = Math.max(largest, difference(a, b, i));
  }
  return { rms: Math.sqrt(sum / (0.75 * a.length)), largest };
}

// What the page shows, and how it follows keys and pointer.
class Page {
  constructor(renderer) {
    const { record } = renderer;
    Object.assign(this, { renderer, record, canvas: document.getElementById("canvas") });
    this.canvas.style.aspectRatio = record.size.join("/");
    this.canvas.style.width = `${record.size[0]}px`;
    this.rows = [...document.getElementById("methods").rows];
    this.reference = record.methods.findIndex((method) => method.is_reference);
    this.light = record.uniforms.light ? record.lights.findIndex((toward) => toward !== null) : -1;
    this.targets = new Map();
    // Pixels of a picture are this many times larger while camera or light move.
    this.coarseness = 8;
    this.number = 0;
    if (record.function) this.editor = new FunctionEditor(record.function, this);
    this.reset();
    this.listen();
  }

  reset() {
    this.camera = structuredClone(this.record.camera);
    this.difference = false;
    this.resetShadows();
  }

  // Returns to the light and the transfer function of the shadow maps.
  resetShadows() {
    this.toward = this.record.lights[this.light];
    this.extinction = 1;
    this.points = this.record.function?.points;
    this.editor?.show();
    this.notice = "";
    this.edited = false;
  }

  // Changes to the reference if the page cannot build the map of the present method for another light or transfer function.
  // Returns whether the method follows them.
  edit() {
    if (!this.method.follows_light && this.reference >= 0) this.number = this.reference;
    this.edited ||= this.method.follows_light;
    return this.method.follows_light;
  }

  listen() {
    this.rows.forEach((row, i) => row.querySelector("button").addEventListener("click", () => this.choose(i)));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) this.drag(event.movementX, event.movementY, event.shiftKey || event.buttons > 1);
    });
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { eye, target } = this.camera;
      this.camera.eye = add(target, scaled(sub(eye, target), Math.exp(0.001 * event.deltaY)));
      this.changed();
    }, { passive: false });
    addEventListener("keydown", (event) => {
      const { key, shiftKey, ctrlKey, metaKey, altKey } = event;
      if (ctrlKey || metaKey || altKey) return;
      if (this.record.methods[Number(key) - 1]) this.choose(Number(key) - 1);
      const arrow = { ArrowLeft: [8, 0], ArrowRight: [-8, 0], ArrowUp: [0, 8], ArrowDown: [0, -8] }[key];
      if (arrow && document.activeElement === this.canvas) {
        event.preventDefault();
        this.drag(...arrow, shiftKey);
      }
      const factor = { "+": EXTINCTION_STEP, "=": EXTINCTION_STEP, "-": 1 / EXTINCTION_STEP }[key];
      if (factor && this.edit()) {
        this.extinction *= factor;
        this.changed();
      }
      if (key === "d" || key === "D") this.toggleDifference();
      if (key === "r" || key === "R") { this.reset(); this.changed(); }
    });
  }

  // Sets the points of the transfer function.
  setPoints(points) {
    if (this.edit()) this.points = points;
    this.changed();
  }

  choose(number) {
    this.number = number;
    this.notice = "";
    if (this.edited && !this.method.follows_light) this.resetShadows();
    this.changed();
  }

  get method() { return this.record.methods[this.number]; }

  toggleDifference() {
    this.difference = !this.difference && this.reference >= 0;
    this.changed();
  }

  drag(x, y, movesLight) {
    const angles = [x, y].map((pixels) => (-2 * Math.PI * pixels) / this.canvas.clientWidth);
    const { eye, target, up } = this.camera;
    const turn = (v) => {
      const about = rotate(v, unit(up), angles[0]);
      const pitched = rotate(about, axesOf(this.camera).right, angles[1]);
      // The view does not turn over the pole.
      const [before, after] = [about, pitched].map((direction) => Math.abs(dot(unit(direction), unit(up))));
      return after >= 0.999 && after > before ? about : pitched;
    };
    if (!movesLight) {
      this.camera.eye = add(target, turn(sub(eye, target)));
    } else if (this.toward && this.edit()) {
      this.toward = turn(this.toward);
    }
    this.changed();
  }

  changed() {
    this.wanted = true;
    this.drawing ??= this.drawAll().catch(fail).finally(() => { this.drawing = undefined; });
  }

  async drawAll() {
    while (this.wanted && !failed) {
      this.wanted = false;
      this.renderer.setScene(this.light, this.toward, this.extinction, this.points);
      const { coarseness } = this;
      try {
        await this.drawAt(coarseness, false);
        if (!this.wanted && coarseness > 1) await this.drawAt(1, true);
      } catch (error) {
        if (!(error instanceof TooLarge)) throw error;
        if (this.reference < 0) return setStatus(`${error.message} R returns to the initial light and transfer function.`);
        this.notice = error.message;
        this.number = this.reference;
        this.wanted = true;
      }
    }
  }

  targetOf(coarseness) {
    const size = this.record.size.map((n) => Math.max(Math.round(n / coarseness), 1));
    if (!this.targets.has(coarseness)) this.targets.set(coarseness, this.renderer.target(size));
    return this.targets.get(coarseness);
  }

  // Draws and shows the present picture, with pixels that are larger by a factor. A refinement stops when another
  // picture is wanted.
  async drawAt(coarseness, isRefinement) {
    const { method, number, difference } = this;
    const camera = structuredClone(this.camera);
    const shouldContinue = () => !failed && !(isRefinement && this.wanted);
    const target = this.targetOf(coarseness);
    const began = performance.now();
    if (!(await this.renderer.draw(method, camera, target, shouldContinue))) return;
    const ms = performance.now() - began;
    const pixels = await this.renderer.pixelsOf(target);
    let reference;
    if (difference) {
      if (!(await this.renderer.draw(this.record.methods[this.reference], camera, target, shouldContinue))) return;
      reference = await this.renderer.pixelsOf(target);
    }
    show(this.canvas, target.size, pixels, reference);
    this.describe(number, ms, coarseness > 1, reference && errors(pixels, reference));
    if (isRefinement) return;
    if (ms > 80) this.coarseness = Math.min(2 * this.coarseness, 16);
    if (ms < 20) this.coarseness = Math.max(this.coarseness / 2, 1);
  }

  describe(number, ms, isPreview, error) {
    document.body.classList.add("draws");
    this.rows.forEach((row, i) => row.toggleAttribute("aria-current", i === number));
    if (!isPreview) this.rows[number].querySelector(".ms").textContent = ms.toFixed(0);
    const parts = [this.notice, this.record.methods[number].label].filter((part) => part);
    if (error) {
      parts.push(`difference from ${this.record.methods[this.reference].label}: rms ${error.rms.toExponential(1)}, ` +
        `largest ${error.largest.toExponential(1)}; white is ${BRIGHTEST} or more`);
    }
    if (this.extinction !== 1) parts.push(`extinction x ${this.extinction.toPrecision(3)}`);
    if (this.points !== this.record.function?.points) parts.push("edited transfer function");
    if (this.edited) parts.push("R returns to the light and the transfer function of the table");
    setStatus(parts.join(". "));
    document.documentElement.dataset.drawn = `${number} ${isPreview ? "preview" : "whole"}`;
  }
}

// Factor of extinction of one key press: three of them double it.
const EXTINCTION_STEP = 2 ** (1 / 3);
// Difference of linear colours that is drawn white.
const BRIGHTEST = 0.1;

// Whether the page has stopped drawing after an error.
let failed = false;

function setStatus(text) {
  if (!failed) document.getElementById("status").textContent = text;
}

// Stops drawing after an error, and shows the stored pictures.
function fail({ message }) {
  setStatus(`${message} The page shows stored pictures instead.`);
  failed = true;
  document.body.classList.remove("draws");
  document.getElementById("status").classList.add("failed");
  document.querySelectorAll("#methods button").forEach((button) => { button.disabled = true; });
}

async function start() {
  // First of all, since a browser without WebGPU may also lack what unpacks the data.
  checkBrowser();
  const { record, bytes } = await unpack();
  const device = await openDevice(record);
  device.lost.then(({ message }) => fail({ message: `The graphics device was lost: ${message}` }));
  device.addEventListener("uncapturederror", ({ error }) => fail(error));
  const page = new Page(new Renderer(device, record, bytes));
  page.changed();
  return page;
}

// The page, for scripts that draw with it.
const umbravox = start();
umbravox.catch(fail);
