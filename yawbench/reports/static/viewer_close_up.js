// One car with its front up: steered wheels, friction circles, the force and its share of the grip at each.

function utilisation(state, wheel) {
  const grip = state['grip_' + wheel];
  return grip > 0 ? Math.hypot(state['force_x_' + wheel], state['force_y_' + wheel]) / grip : NaN;
}

function drawCloseUp(canvas, density, run, number, state, scale, strongest) {
  const {context: c, width, height} = surface(canvas, density);
  if (!width || !height) return;
  const car = run.car;
  const reach = Math.max(run.widest * scale, 0.55 * car.track);
  const front = Math.max(car.front_end, car.front_axle + reach);
  const rear = Math.max(car.rear_end, car.rear_axle + reach);
  const zoom = Math.min(width / (car.track + 2 * reach + 0.1), (height - 60) / (front + rear));
  const px = 1 / zoom;
  const middle = 18 + front * zoom;
  const onPage = (x, y) => [width / 2 - y * zoom, middle - x * zoom];
  c.save();
  c.translate(width / 2, middle);
  c.scale(zoom, -zoom);
  c.rotate(Math.PI / 2);
  body(c, car, run, number, px);
  wheels(c, car, state.steer);
  circles(c, run, state, scale, px);
  forces(c, run, state, scale, INK, 2.2, px);
  if (Number.isFinite(state.sideslip)) motion(c, state, car, run, px);
  if ('yaw_moment' in state && strongest > 0) moment(c, state.yaw_moment / strongest, px);
  c.restore();
  if ('grip_fl' in state && 'force_x_fl' in state) {
    for (const [name, [x, y]] of Object.entries(wheelsOf(car))) {
      const share = utilisation(state, name);
      if (!(share >= 0)) continue;
      const [across, down] = onPage(x + Math.sign(x) * reach, y + Math.sign(y) * 0.3 * reach);
      text(c, `${(100 * share).toFixed(0)} %`, across, down - 8 * Math.sign(x), {align: 'center', colour: INK, size: 13});
    }
  }
  if (scale > 0) {
    const newtons = round(0.45 * width / zoom / scale);
    bar(c, 8, height - 8, newtons * scale * zoom, newtons < 1000 ? `${newtons} N` : `${newtons / 1000} kN`);
  }
}

// The car's axis, and beside it where the centre of mass moves: the sideslip angle lies between.
function motion(c, state, car, run, px) {
  const length = 0.85 * car.front_axle;
  polyline(c, [-0.3, length], [0, 0]);
  stroke(c, QUIET, 1, px, [4, 3]);
  arrow(c, 0, 0, length * Math.cos(state.sideslip), length * Math.sin(state.sideslip), run.colour, 2, px);
  circle(c, 0, 0, 3 * px);
  c.fillStyle = run.colour;
  c.fill();
}

// The yaw moment as an arc round the centre of mass, from behind; three quarters of half a turn at its largest.
function moment(c, share, px) {
  const radius = 0.42;
  const sweep = share * 0.75 * Math.PI;
  if (Math.abs(sweep) < 0.03) return;
  const [from, to] = [Math.PI, Math.PI + sweep];
  c.beginPath();
  c.arc(0, 0, radius, from, to, sweep < 0);
  stroke(c, QUIET, 3, px);
  const side = Math.sign(sweep);
  const [x, y] = [radius * Math.cos(to), radius * Math.sin(to)];
  const [tx, ty] = [-Math.sin(to) * side * 9 * px, Math.cos(to) * side * 9 * px];
  filled(c, QUIET, [[x + tx, y + ty], [x - ty * 0.6, y + tx * 0.6], [x + ty * 0.6, y - tx * 0.6]]);
}
