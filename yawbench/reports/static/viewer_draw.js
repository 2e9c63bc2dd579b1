// What scene and close-up share. Contexts are in metres, y to the left; px is the size of a pixel in metres.

let [GROUND, QUIET, INK, LINE, LANE] = ['#fff', '#666', '#111', '#e2e2e2', '#f0ede4'];
const TYRE = [0.62, 0.2]; // length, width of a wheel seen from above [m]

// Take the colours of the page, light or dark.
function useTheme({ground, quiet, ink, line, lane}) {
  [GROUND, QUIET, INK, LINE, LANE] = [ground, quiet, ink, line, lane];
}

// Fit a canvas's pixels to its size on the page; return its context, width and height there.
function surface(canvas, density) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const ratio = density || window.devicePixelRatio || 1;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.beginPath();
  context.rect(0, 0, width, height);
  context.clip(); // when printed, a canvas is not clipped to its box
  context.fillStyle = GROUND;
  context.fillRect(0, 0, width, height);
  return {context, width, height};
}

// Begin a path through points, up to the last one.
function polyline(c, xs, ys, last = xs.length - 1) {
  c.beginPath();
  for (let i = 0; i <= last; i++) c.lineTo(xs[i], ys[i]);
}

// Fill a polygon.
function filled(c, colour, points) {
  c.beginPath();
  for (const [x, y] of points) c.lineTo(x, y);
  c.fillStyle = colour;
  c.fill();
}

// Begin a path around a point.
function circle(c, x, y, radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
}

function stroke(c, colour, width, px, dash = []) {
  c.strokeStyle = colour;
  c.lineWidth = width * px;
  c.setLineDash(dash.map((part) => part * width * px));
  c.stroke();
  c.setLineDash([]);
}

function arrow(c, x, y, dx, dy, colour, width, px) {
  const length = Math.hypot(dx, dy);
  if (!(length > 1.5 * px)) return;
  const head = Math.min(4.5 * width * px, 0.6 * length);
  const [ux, uy] = [dx / length, dy / length];
  const [bx, by] = [x + dx - ux * head, y + dy - uy * head];
  const [wx, wy] = [-uy * head * 0.45, ux * head * 0.45];
  polyline(c, [x, bx], [y, by]);
  stroke(c, colour, width, px);
  filled(c, colour, [[x + dx, y + dy], [bx + wx, by + wy], [bx - wx, by - wy]]);
}

// Outline with rounded corners, a windscreen towards the front.
function body(c, car, run, number, px) {
  c.beginPath();
  c.roundRect(-car.rear_end, -car.width / 2, car.front_end + car.rear_end, car.width, [0.35, 0.5, 0.5, 0.35]);
  if (number === 0) {
    c.globalAlpha = 0.13;
    c.fillStyle = run.colour;
    c.fill();
    c.globalAlpha = 1;
  }
  stroke(c, run.colour, 2, px, run.dash);
  const screen = car.front_axle * 0.45;
  c.beginPath();
  c.moveTo(screen, car.width * 0.38);
  c.quadraticCurveTo(screen + 0.3, 0, screen, -car.width * 0.38);
  stroke(c, run.colour, 1.2, px);
}

function wheels(c, car, steer) {
  for (const [name, [x, y]] of Object.entries(wheelsOf(car))) {
    c.save();
    c.translate(x, y);
    if (name[0] === 'f') c.rotate(steer);
    c.fillStyle = INK;
    c.fillRect(-TYRE[0] / 2, -TYRE[1] / 2, TYRE[0], TYRE[1]);
    c.restore();
  }
}

function forces(c, run, state, scale, colour, width, px) {
  if (!('force_x_fl' in state) || !scale) return;
  for (const [name, [x, y]] of Object.entries(wheelsOf(run.car))) {
    arrow(c, x, y, state['force_x_' + name] * scale, state['force_y_' + name] * scale, colour, width, px);
  }
}

function circles(c, run, state, scale, px) {
  if (!('grip_fl' in state) || !scale) return;
  for (const [name, [x, y]] of Object.entries(wheelsOf(run.car))) {
    const radius = state['grip_' + name] * scale;
    if (!(radius > 0)) continue;
    circle(c, x, y, radius);
    stroke(c, QUIET, 1, px);
  }
}

// A round number of at most `largest`: 1, 2 or 5 times a power of ten.
function round(largest) {
  const power = 10 ** Math.floor(Math.log10(largest));
  return [5, 2, 1].find((step) => step * power <= largest) * power;
}

function text(c, words, x, y, {align = 'left', colour = QUIET, size = 12, halo = true, ground = GROUND} = {}) {
  c.font = `${size}px system-ui, sans-serif`;
  c.textAlign = align;
  c.textBaseline = 'middle';
  if (halo) {
    c.strokeStyle = ground;
    c.lineWidth = size / 4;
    c.lineJoin = 'round';
    c.strokeText(words, x, y);
  }
  c.fillStyle = colour;
  c.fillText(words, x, y);
}

// A bar of a round length with its words, its left end at x, y.
function bar(c, x, y, length, words) {
  polyline(c, [x, x, x + length, x + length], [y - 4, y, y, y - 4]);
  stroke(c, GROUND, 5, 1);
  stroke(c, INK, 1.5, 1);
  text(c, words, x + length + 6, y - 2, {colour: INK});
}
