// The road from above: lanes between cones, paths, cars; the camera follows.

const NEAR = [12, 20]; // pixels per metre that the camera begins with: least, most
const CONES = 5; // metres between cones at most; chosen: told apart from a wall
const SHOWS_FORCES = 11; // pixels per metre from which forces can be read in the scene

// Centre and scale of the view.
function look(view, runs, states, width, height) {
  if (view.camera === 'whole') {
    let [xs, ys] = [[Infinity, -Infinity], [Infinity, -Infinity]];
    for (const run of runs) {
      xs = extremes(run.channels.x, xs);
      ys = extremes(run.channels.y, ys);
      for (const [start, end, right, left] of run.lanes) {
        xs = extremes([start, end], xs);
        ys = extremes([right, left], ys);
      }
    }
    const scale = Math.min((width - 40) / (xs[1] - xs[0] + 6), (height - 60) / (ys[1] - ys[0] + 6));
    return {x: (xs[0] + xs[1]) / 2, y: (ys[0] + ys[1]) / 2, scale: scale * Math.max(view.zoom, 1)};
  }
  const usual = Math.min(Math.max(width / 45, NEAR[0]), NEAR[1]) * view.zoom;
  if (view.camera !== 'cars') {
    const {x, y} = states[view.camera];
    return {x, y, scale: usual};
  }
  const xs = extremes(states.map((state) => state.x));
  const ys = extremes(states.map((state) => state.y));
  const fits = Math.min((width - 100) / (xs[1] - xs[0]), (height - 100) / (ys[1] - ys[0]));
  return {x: (xs[0] + xs[1]) / 2, y: (ys[0] + ys[1]) / 2, scale: Math.min(usual, fits)};
}

// Round numbers within a half width of a middle: where lines of the grid are.
function gridLines(middle, half, scale) {
  const step = round(Math.max(110 / scale, 1));
  const first = Math.ceil((middle - half) / step);
  const last = Math.floor((middle + half) / step);
  return Array.from({length: last - first + 1}, (_, k) => (first + k) * step);
}

function grid(c, eye, width, height) {
  const across = width / 2 / eye.scale;
  const up = height / 2 / eye.scale;
  c.beginPath();
  for (const x of gridLines(eye.x, across, eye.scale)) {
    c.moveTo(x, eye.y - up);
    c.lineTo(x, eye.y + up);
  }
  for (const y of gridLines(eye.y, up, eye.scale)) {
    c.moveTo(eye.x - across, y);
    c.lineTo(eye.x + across, y);
  }
  stroke(c, LINE, 1, 1 / eye.scale);
}

function gridWords(c, eye, width, height) {
  for (const x of gridLines(eye.x, width / 2 / eye.scale, eye.scale)) {
    const at = width / 2 + (x - eye.x) * eye.scale;
    if (at > 60 && at < width - 24) text(c, `${decimal(x, 0)} m`, at, height - 10, {align: 'center', size: 11});
  }
  for (const y of gridLines(eye.y, height / 2 / eye.scale, eye.scale)) {
    const at = height / 2 - (y - eye.y) * eye.scale;
    if (at > 14 && at < height - 24) text(c, `${decimal(y, 0)} m`, 6, at, {size: 11});
  }
}

// Paint friction by place, from white, 1 and more, to blue, none, where it is in sight.
function paintFriction(runs, fill, inSight = () => true) {
  for (const ground of new Set(runs.map((run) => run.ground))) {
    for (const [friction, corners] of ground) {
      const less = 1 - Math.min(friction, 1);
      if (inSight(corners)) fill(corners, `rgb(${255 - 135 * less}, ${255 - 75 * less}, ${255 - 25 * less})`);
    }
  }
}

// Where lanes lie, and where their cones touch them, with the side on which these stand.
function laid(lanes) {
  return lanes.map(([start, end, right, left]) => {
    const pieces = Math.ceil((end - start) / CONES);
    const xs = Array.from({length: pieces + 1}, (_, i) => start + (i * (end - start)) / pieces);
    return {corners: [[start, right], [end, right], [end, left], [start, left]], cones: xs.flatMap((x) => [[x, left, 1], [x, right, -1]])};
  });
}

function lanes(c, run, px, onGround) {
  const size = Math.max(0.15, 2.2 * px);
  for (const {corners, cones} of run.laid) {
    if (!onGround) filled(c, LANE, corners);
    c.fillStyle = '#8a4b00';
    for (const [x, y, out] of cones) {
      circle(c, x, y + out * size, size);
      c.fill();
    }
  }
}

function drawScene(canvas, density, runs, states, view, scale) {
  const {context: c, width, height} = surface(canvas, density);
  if (!width || !height) return;
  const eye = look(view, runs, states, width, height);
  const px = 1 / eye.scale;
  c.save();
  c.translate(width / 2, height / 2);
  c.scale(eye.scale, -eye.scale);
  c.translate(-eye.x, -eye.y);
  paintFriction(runs, (corners, colour) => filled(c, colour, corners));
  grid(c, eye, width, height);
  for (const run of view.lanes) {
    lanes(c, run, px, runs.some((one) => one.ground.length));
    if ('path_y' in run.channels) {
      polyline(c, run.channels.x, run.channels.path_y);
      stroke(c, QUIET, 1, px, [5, 4]);
    }
  }
  runs.forEach((run, i) => {
    const {x, y} = run.channels;
    polyline(c, x, y);
    c.globalAlpha = 0.3;
    stroke(c, run.colour, 1.2, px, run.dash);
    c.globalAlpha = 1;
    polyline(c, x, y, states[i].index);
    c.lineTo(states[i].x, states[i].y);
    stroke(c, run.colour, 2, px, run.dash);
  });
  runs.forEach((run, i) => {
    const state = states[i];
    c.save();
    c.translate(state.x, state.y);
    c.rotate(state.yaw);
    wheels(c, run.car, state.steer);
    body(c, run.car, run, i, px);
    if (eye.scale >= SHOWS_FORCES) forces(c, run, state, scale, INK, 1.4, px);
    c.restore();
  });
  c.restore();
  gridWords(c, eye, width, height);
  runs.forEach((run, i) => {
    const at = [width / 2 + (states[i].x - eye.x) * eye.scale, height / 2 - (states[i].y - eye.y) * eye.scale];
    states[i].screen = at;
    marker(c, run, i, at, eye, width, height, states[i]);
  });
}

// A dot on a car that is too small to see, an arrow at the edge towards one that is out of sight.
function marker(c, run, number, [x, y], eye, width, height, state) {
  const [inX, inY] = [Math.min(Math.max(x, 16), width - 16), Math.min(Math.max(y, 16), height - 16)];
  if (Math.hypot(x - inX, y - inY) > 3 * eye.scale + 10) {
    const [dx, dy] = [x - width / 2, y - height / 2];
    const far = Math.hypot(dx, dy);
    arrow(c, inX - (26 * dx) / far, inY - (26 * dy) / far, (26 * dx) / far, (26 * dy) / far, run.colour, 3, 1);
    const away = Math.hypot(state.x - eye.x, state.y - eye.y);
    const right = inX > width / 2;
    text(c, `${away.toFixed(0)} m`, inX + (right ? -32 : 32), inY + (inY > height / 2 ? -16 : 16),
      {align: right ? 'right' : 'left', colour: run.colour});
  } else if (eye.scale < 4) {
    circle(c, x, y, 5);
    c.fillStyle = number === 0 ? run.colour : GROUND;
    c.fill();
    stroke(c, run.colour, 2, 1);
  }
}
