// The scene in three dimensions on a canvas: cars with roll and pitch, wheels, forces, cones, ground, from four
// cameras. Axes are those of ISO 8855: x forward, y to the left, z up. One car is solid, the others are ghosts.

const SPACE = {
  chase: {says: 'from behind', turn: Math.PI, rise: 0.3, far: 9, with: true}, // where the eye is: angle from the
  side: {says: 'from the side', turn: -Math.PI / 2, rise: 0.12, far: 8, with: true}, // car's or the road's x axis,
  fixed: {says: 'from the roadside', turn: -2.0, rise: 0.16, far: 30, with: false}, // angle above the road,
  orbit: {says: 'from around', turn: -2.4, rise: 0.45, far: 12, with: false}, // distance [m]; whether it turns with
}; // the car. Chosen: all of the car and of its forces in sight
const CAMERAS = Object.keys(SPACE);
const NEAREST = 0.3; // what is nearer to the eye is not drawn [m]
const SEEN = 90; // how far ground and cones are drawn [m]; chosen: beyond, they are specks
const FIELD = 1.1; // width of the picture over its distance; chosen: an angle of 58 degrees
const AT_GRIP = 0.95; // share of the grip from which a force counts as at its limit; chosen: that of the events
const CONE = [0.15, 0.6]; // radius and height [m]; chosen: a cone of 0.6 m
const DEEP = 1; // by how much a car's parts are moved apart, where the order of their depths would be wrong [m]
const LIGHT = [0.36, 0.48, 0.8]; // towards the sun
const HOT = '#d6006c';

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
const ring = (n) => Array.from({length: n}, (_, i) => [Math.cos((2 * Math.PI * i) / n), Math.sin((2 * Math.PI * i) / n)]);
const [TREAD, ROUND] = [ring(16), ring(32)];

// Rotation by yaw, pitch (nose down), roll (left side up), then a shift, as a function of points.
function placing([x, y, z], yaw, pitch = 0, roll = 0) {
  const [cy, sy, cp, sp, cr, sr] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch), Math.cos(roll), Math.sin(roll)];
  return ([a, b, c]) => [
    x + cy * cp * a + (cy * sp * sr - sy * cr) * b + (cy * sp * cr + sy * sr) * c,
    y + sy * cp * a + (sy * sp * sr + cy * cr) * b + (sy * sp * cr - cy * sr) * c,
    z - sp * a + cp * sr * b + cp * cr * c];
}

// What is seen from a point: directions, and places on the canvas.
class Eye {
  constructor(from, to, width, height, focus) {
    this.from = from;
    this.ahead = unit(minus(to, from));
    this.right = unit(cross(this.ahead, [0, 0, 1]));
    this.up = cross(this.right, this.ahead);
    Object.assign(this, {width, height, focus});
  }

  // To the right, up and ahead of the eye [m].
  seen(point) { const d = minus(point, this.from); return [dot(d, this.right), dot(d, this.up), dot(d, this.ahead)]; }

  flat([x, y, z]) { return [this.width / 2 + (this.focus * x) / z, this.height / 2 - (this.focus * y) / z]; }

  // Points before the eye, cut at the nearest plane; closed: of a polygon.
  before(points, closed = true) {
    const all = points.map((point) => this.seen(point));
    if (all.every((point) => point[2] >= NEAREST)) return all;
    const kept = [];
    all.forEach((point, i) => {
      const last = all[i - 1] ?? (closed ? all.at(-1) : null);
      if (last && (last[2] < NEAREST) !== (point[2] < NEAREST)) {
        const part = (NEAREST - last[2]) / (point[2] - last[2]);
        kept.push([last[0] + part * (point[0] - last[0]), last[1] + part * (point[1] - last[1]), NEAREST]);
      }
      if (point[2] >= NEAREST) kept.push(point);
    });
    return kept;
  }
}

// The part of a segment, from 0 to 1, that lies within a picture.
function within(x, y, dx, dy, width, height) {
  let [from, to] = [0, 1];
  for (const [place, step, most] of [[x, dx, width], [y, dy, height]]) {
    if (!step && (place < 0 || place > most)) return [1, 0];
    const [one, other] = step ? [-place / step, (most - place) / step] : [0, 1];
    [from, to] = [Math.max(from, Math.min(one, other)), Math.min(to, Math.max(one, other))];
  }
  return [from, to];
}

// Paints what lies on the ground at once, solids and arrows from far to near.
class Painter {
  constructor(context, eye) { Object.assign(this, {context, eye, solids: []}); }

  fill(points, colour) {
    const seen = this.eye.before(points);
    if (seen.length < 3) return false;
    filled(this.context, colour, seen.map((point) => this.eye.flat(point)));
    return true;
  }

  // A line, without what lies beside the picture: dashes of long lines would take long.
  line(points, colour, width, dash) {
    const {context: c, eye} = this;
    const flat = eye.before(points, false).map((point) => eye.flat(point));
    c.beginPath();
    for (let i = 1; i < flat.length; i++) {
      const [[x, y], [u, v]] = [flat[i - 1], flat[i]];
      const [a, b] = within(x, y, u - x, v - y, eye.width, eye.height);
      if (a >= b) continue;
      if (i === 1 || a > 0) c.moveTo(x + a * (u - x), y + a * (v - y));
      c.lineTo(x + b * (u - x), y + b * (v - y));
    }
    stroke(c, colour, width, 1, dash);
  }

  // A flat face of a solid, seen from outside alone; painted as if it were `behind` by that much [m].
  face(points, rgb, alpha, behind = 0) {
    const {eye} = this;
    const normal = unit(cross(minus(points[1], points[0]), minus(points[2], points[0])));
    if (dot(normal, minus(eye.from, points[0])) <= 0) return;
    const bright = 0.7 + 0.35 * Math.max(dot(normal, LIGHT), 0);
    const colour = `rgb(${rgb.map((part) => Math.round(Math.min((part + 12) * bright, 255))).join(' ')} / ${alpha})`;
    const depth = points.reduce((sum, point) => sum + eye.seen(point)[2], 0) / points.length + behind;
    this.solids.push([depth, () => {
      if (this.fill(points, colour) && alpha === 1) stroke(this.context, colour, 0.7, 1); // closes the gaps between faces
    }]);
  }

  // A solid between two rings of points, counter-clockwise seen from the second, which closes it.
  solid(low, high, rgb, alpha, {lid = true, behind = 0} = {}) {
    low.forEach((point, i) => {
      const j = (i + 1) % low.length;
      this.face([point, low[j], high[j], high[i]], rgb, alpha, behind);
    });
    if (lid) this.face(high, rgb, alpha, behind);
  }

  arrow(from, along, colour, width) {
    const to = [0, 1, 2].map((k) => from[k] + along[k]);
    const [a, b] = [from, to].map((point) => this.eye.seen(point));
    if (Math.min(a[2], b[2]) < NEAREST) return;
    const [[x, y], [u, v]] = [a, b].map((point) => this.eye.flat(point));
    polyline(this.context, [x, u], [y, v]);
    stroke(this.context, GROUND, width + 2, 1); // told apart from what is behind it
    arrow(this.context, x, y, u - x, v - y, colour, width, 1);
  }

  finish() {
    this.solids.sort((one, other) => other[0] - one[0]);
    for (const [, paint] of this.solids) paint();
    this.solids = [];
  }
}

function rgbOf(colour) {
  const digits = colour.replace('#', '');
  const parts = digits.length < 6 ? [...digits.slice(0, 3)].map((one) => one + one) : digits.match(/../g).slice(0, 3);
  return parts.map((part) => parseInt(part, 16));
}

// The eye of a camera; `look`: by how much the reader has turned and raised it; `near`: zoom.
function eyeOf(camera, state, run, look, near, width, height) {
  const {turn, rise, far, with: turns} = SPACE[camera];
  const angle = turn + look[0] + (turns ? state.yaw : 0);
  const up = Math.min(Math.max(rise + look[1], 0.02), 1.55);
  const to = [state.x, state.y, 0.5 * run.car.height];
  const around = ([x, y, z], distance) => [
    x + distance * Math.cos(up) * Math.cos(angle), y + distance * Math.cos(up) * Math.sin(angle), z + distance * Math.sin(up)];
  const focus = Math.min(width, 1.8 * height) / FIELD;
  if (camera !== 'fixed') return new Eye(around(to, far / near), to, width, height, focus);
  const {x, y} = run.channels;
  const middle = Math.floor(x.length / 2);
  const from = around([x[middle], y[middle], 0.5 * run.car.height], far);
  const zoom = Math.max(Math.hypot(...minus(to, from)) / far, 0.4) ** 0.6; // as a person who films does
  return new Eye(from, to, width, height, 3 * focus * near * zoom);
}

function paintGround(p, runs, lanes, at) {
  const {context: c, eye} = p;
  const horizon = eye.height / 2 + (eye.focus * eye.ahead[2]) / Math.hypot(eye.ahead[0], eye.ahead[1]);
  c.globalAlpha = 0.5;
  c.fillStyle = LINE;
  c.fillRect(0, Math.max(horizon, 0), eye.width, eye.height);
  c.globalAlpha = 1;
  const flat = (corners) => corners.map(([x, y]) => [x, y, 0]);
  const inSight = (corners) => [0, 1].every((k) => {
    const [low, high] = extremes(corners.map((one) => one[k]));
    return low <= at[k] + SEEN && high >= at[k] - SEEN;
  });
  paintFriction(runs, (corners, colour) => p.fill(flat(corners), colour), inSight);
  const [x0, y0] = at.map((one) => 10 * Math.round(one / 10));
  for (let k = -60; k <= 60; k += 10) {
    p.line([[x0 + k, y0 - 60, 0], [x0 + k, y0 + 60, 0]], LINE, 1);
    p.line([[x0 - 60, y0 + k, 0], [x0 + 60, y0 + k, 0]], LINE, 1);
  }
  for (const run of lanes) {
    for (const {corners, cones} of run.laid) {
      p.fill(flat(corners), LANE);
      for (const [x, y, out] of cones) if (Math.hypot(x - at[0], y - at[1]) < SEEN) paintCone(p, x, y + out * CONE[0]);
    }
    if (run.along.path) p.line(run.along.path, QUIET, 1.5, [5, 4]);
  }
}

function paintCone(p, x, y) {
  const foot = ring(6).map(([a, b]) => [x + CONE[0] * a, y + CONE[0] * b, 0]);
  foot.forEach((one, i) => p.face([one, foot[(i + 1) % 6], [x, y, CONE[1]]], [236, 110, 20], 1));
}

// The path of a car so thinned that a line through it looks the same, made once.
function thinnedPath(channels) {
  const {x, y, path_y: planned} = channels;
  const step = Math.max(Math.floor(x.length / 600), 1);
  const rows = Array.from({length: Math.ceil(x.length / step)}, (_, k) => k * step);
  return {step, own: rows.map((i) => [x[i], y[i], 0.01]), path: planned && rows.map((i) => [x[i], planned[i], 0.01])};
}

// Height of a wheel above its place on the road at a time; 0 but where it is lifted.
function liftOf(run, wheel, time) {
  for (const [name, begin, step, heights] of run.road.lifts || []) {
    const k = (time - begin) / step;
    if (name === wheel && k >= 0 && k < heights.length - 1) return heights[Math.floor(k)] + (k % 1) * (heights[Math.floor(k) + 1] - heights[Math.floor(k)]);
  }
  return 0;
}

function paintCar(p, run, state, {ghost, scale, strongest, time}) {
  const {car} = run;
  const [alpha, rgb] = [ghost ? 0.3 : 1, rgbOf(run.colour)];
  const {yaw, roll_angle: roll = 0, pitch_angle: pitch = 0, heave = 0} = state;
  const place = placing([state.x, state.y, 0], yaw);
  const turn = placing([0, 0, car.pivot + heave], 0, pitch, roll);
  const body = (points) => points.map(([x, y, z]) => place(turn([x, y, z - car.pivot])));
  const level = (front, rear, half, ahead, behind = ahead) => body([[front, half, ahead], [-rear, half, behind], [-rear, -half, behind], [front, -half, ahead]]);
  const [f, r, w, h] = [car.front_end, car.rear_end, car.width / 2, car.height];
  const inner = Math.min(car.track / 2 - 0.14, w);
  const arch = Math.min(2 * car.radius + 0.03, 0.55 * h);
  const sill = level(f - 0.1, r - 0.1, inner, 0.14 * h);
  const low = level(f - 0.02, r - 0.02, inner, arch - 0.04);
  const middle = level(f, r, w, arch);
  const belt = level(f - 0.12, r - 0.06, 0.96 * w, Math.max(arch, 0.5 * h) + 0.01, Math.max(arch, 0.6 * h) + 0.02);
  const cabin = level(0.5 * car.front_axle, car.rear_axle + 0.3 * (r - car.rear_axle), 0.9 * w, 0.53 * h, 0.6 * h);
  const roof = level(0.5 * car.front_axle - 0.42 * h, car.rear_axle - 0.12 * h, 0.72 * w, h, 0.98 * h);
  p.solid(sill, low, rgb.map((one) => 0.6 * one), alpha, {lid: false, behind: DEEP});
  p.solid(low, middle, rgb, alpha, {lid: false, behind: DEEP});
  p.solid(middle, belt, rgb, alpha, {behind: -DEEP});
  p.solid(cabin, roof, [96, 110, 122], alpha, {lid: false, behind: -1.5 * DEEP});
  p.face(roof, rgb, alpha, -1.5 * DEEP);
  const wheels = wheelsOf(car);
  const beside = dot(minus(p.eye.from, place([0, 0, 0])), [-Math.sin(yaw), Math.cos(yaw), 0]); // the eye, to the left
  const down = car.wheels_turn ? car.pivot - car.radius : 0;
  for (const [name, [x, y]] of Object.entries(wheels)) {
    const at = placing([x - down * pitch, y + down * roll, car.radius + liftOf(run, name, time)], name[0] === 'f' ? state.steer : 0, 0, 0.7 * roll);
    const turned = state['turned_' + name] || 0;
    const disc = (across, radius) => TREAD.map(([a, b]) => place(at([radius * a, across, radius * b])));
    const outside = Math.sign(y);
    const [inside, outer] = [disc(-0.1 * outside, car.radius), disc(0.1 * outside, car.radius)];
    const behind = outside * beside > 0 ? 0 : 2 * DEEP; // those on the other side are hidden by the body
    const order = outside > 0 ? (points) => [...points].reverse() : (points) => points;
    p.solid(order(inside), order(outer), [52, 52, 54], alpha, {behind});
    p.face(order(disc(0.105 * outside, 0.6 * car.radius)), [176, 178, 182], alpha, behind);
    if (!ghost) p.face(order(TREAD.slice(0, 9).map(([a, b]) => {
      const [cos, sin] = [Math.cos(turned), -Math.sin(turned)];
      return place(at([0.58 * car.radius * (a * cos - b * sin), 0.108 * outside, 0.58 * car.radius * (a * sin + b * cos)]));
    })), [120, 122, 126], alpha, behind);
  }
  return () => paintForces(p, run, state, {place, wheels, down: car.wheels_turn ? car.pivot : 0, ghost, scale, strongest});
}

// Forces on the ground against their circles, before solids hide them or after: arrows are always seen.
function paintForces(p, run, state, {place, wheels, down, ghost, scale, strongest}) {
  const {car} = run;
  const {yaw, roll_angle: roll = 0, pitch_angle: pitch = 0} = state;
  const across = placing([0, 0, 0], yaw);
  for (const [name, [x, y]] of Object.entries(wheels)) {
    if (!('force_x_' + name in state) || !scale) break;
    const [fx, fy, share] = [state['force_x_' + name], state['force_y_' + name], utilisation(state, name)];
    const foot = place([x - down * pitch, y + down * roll, 0.03]);
    const colour = ghost ? run.colour : share > AT_GRIP ? HOT : INK;
    p.arrow(foot, across([fx * scale, fy * scale, 0]), colour, ghost ? 1.2 : 2.6);
    if (!ghost && 'load_' + name in state) p.arrow(foot, [0, 0, 0.5 * scale * state['load_' + name]], QUIET, 1.2);
  }
  const above = place([0, 0, car.height + 0.15]);
  if (Number.isFinite(state.sideslip)) p.arrow(above, across([1.5 * Math.cos(state.sideslip), 1.5 * Math.sin(state.sideslip), 0]), run.colour, ghost ? 1.2 : 2.4);
  if (ghost) return;
  const wind = (state.wind_force_y || 0) * scale * 2;
  if (Math.abs(wind) > 0.05) p.arrow(place([0.2, -Math.sign(wind) * (car.width / 2 + 0.2) - wind, 0.6 * car.height]), across([0, wind, 0]), '#2a8fd0', 3);
  const sweep = strongest > 0 ? (state.yaw_moment || 0) / strongest * 0.75 * Math.PI : 0;
  if (Math.abs(sweep) < 0.03) return;
  const arc = Array.from({length: 17}, (_, i) => place([1.1 * Math.cos((sweep * i) / 16), 1.1 * Math.sin((sweep * i) / 16), car.height + 0.12]));
  p.line(arc.slice(0, -2), QUIET, 3.5);
  p.arrow(arc.at(-3), minus(arc.at(-1), arc.at(-3)), QUIET, 3.5);
}

function paintCircles(p, run, state, {ghost, scale}) {
  if (!('grip_fl' in state) || !scale) return;
  const place = placing([state.x, state.y, 0], state.yaw);
  const down = run.car.wheels_turn ? run.car.pivot : 0;
  const {roll_angle: roll = 0, pitch_angle: pitch = 0} = state;
  for (const [name, [x, y]] of Object.entries(wheelsOf(run.car))) {
    const radius = state['grip_' + name] * scale;
    const hot = !ghost && utilisation(state, name) > AT_GRIP;
    const points = ROUND.map(([a, b]) => place([x - down * pitch + a * radius, y + down * roll + b * radius, 0.02]));
    p.line([...points, points[0]], hot ? HOT : ghost ? run.colour : QUIET, hot ? 2.2 : 1.1);
  }
}

// Draw cars and ground from a camera; `lead`: number of the car that it follows among `runs`.
function drawSpace(canvas, density, runs, states, {camera, lead, lanes, look, near, scale, strongest, time}) {
  const {context, width, height} = surface(canvas, density);
  if (!width || !height) return;
  const eye = eyeOf(camera, states[lead], runs[lead], look, near, width, height);
  const p = new Painter(context, eye);
  for (const run of runs) run.along ??= thinnedPath(run.channels);
  paintGround(p, runs, lanes, [states[lead].x, states[lead].y]);
  const settings = (i) => ({ghost: i !== lead, scale, strongest, time});
  runs.forEach((run, i) => {
    const {own, step} = run.along;
    context.globalAlpha = 0.35;
    p.line(own, run.colour, 1.5, run.dash);
    context.globalAlpha = 1;
    p.line([...own.slice(0, Math.floor(states[i].index / step) + 1), [states[i].x, states[i].y, 0.01]], run.colour, 2.5, run.dash);
    paintCircles(p, run, states[i], settings(i));
  });
  const after = runs.map((run, i) => paintCar(p, run, states[i], settings(i)));
  p.finish();
  for (const paint of after) paint();
  runs.forEach((run, i) => {
    const seen = eye.seen([states[i].x, states[i].y, run.car.height + 0.5]);
    const [x, y] = eye.flat(seen);
    if (runs.length > 1 && seen[2] > NEAREST) text(context, run.label, x, y - 14 * i, {align: 'center', colour: run.colour, size: 12});
  });
  const degrees = (name, words) => (name in states[lead] ? [`${words} ${decimal((180 / Math.PI) * states[lead][name], 1)}°`] : []);
  text(context, [`${time.toFixed(2)} s`, ...degrees('roll_angle', 'roll'), ...degrees('pitch_angle', 'pitch')].join(', '), 8, height - 12, {size: 11});
}

// Turn the eye by dragging, or by two fingers; `moved` gets the angles.
function turnByDragging(canvas, active, moved) {
  let held = null;
  canvas.addEventListener('pointerdown', (event) => {
    if (!active()) return;
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!held) return;
    moved(-(event.clientX - held[0]) * 0.008, (event.clientY - held[1]) * 0.006);
    held = [event.clientX, event.clientY];
  });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, () => { held = null; });
}
