// The road from above and a close-up of each car, at the cursor's time; plays.

// Channels that a run may have, beside its place; sideslip is NaN while the car stands.
const MORE = [
  'yaw_rate', 'steer_angle', 'yaw_moment', 'cone_overrun', 'sideslip', 'roll_angle', 'pitch_angle', 'heave', 'wind_force_y',
];

// What scene and close-ups need of a run: channels in SI units at every recorded row.
function channelsOf(run) {
  const {road} = run;
  const column = (name) => (road[name] ? run.column(road[name]) : null);
  const channels = {time: run.shifted, x: column('x'), y: column('y'), yaw: unwrapped(column('yaw'))};
  for (const name of MORE) if (road[name]) channels[name] = column(name);
  if (road.path_offset) {
    const off = column('path_offset');
    channels.path_y = channels.y.map((y, i) => y - off[i]);
  }
  for (const wheel of WHEELS.filter((one) => road['spin_' + one])) {
    let turned = 0;
    channels['turned_' + wheel] = column('spin_' + wheel).map((speed, i) => (turned += i ? speed * (run.time[i] - run.time[i - 1]) : 0));
  }
  for (const wheel of WHEELS) {
    if (!road['force_along_' + wheel]) break;
    const [fx, fy] = [column('force_along_' + wheel), column('force_across_' + wheel)];
    const angle = wheel[0] === 'f' && channels.steer_angle;
    channels['force_x_' + wheel] = angle ? fx.map((f, i) => f * Math.cos(angle[i]) - fy[i] * Math.sin(angle[i])) : fx;
    channels['force_y_' + wheel] = angle ? fx.map((f, i) => f * Math.sin(angle[i]) + fy[i] * Math.cos(angle[i])) : fy;
    if (!('friction_' + wheel in road)) continue;
    const mu = road['friction_' + wheel];
    const friction = typeof mu === 'number' ? () => mu : ((values) => (i) => values[i])(run.column(mu));
    channels['load_' + wheel] = column('load_' + wheel);
    channels['grip_' + wheel] = channels['load_' + wheel].map((load, i) => friction(i) * Math.max(load, 0));
  }
  return untilLost(channels);
}

// The channels until the position ceases to be finite, as in a run that failed.
function untilLost(channels) {
  const {x, y, yaw} = channels;
  const lost = x.findIndex((_, i) => !Number.isFinite(x[i] + y[i] + yaw[i]));
  if (lost < 0) return channels;
  return Object.fromEntries(Object.entries(channels).map(([name, values]) => [name, values.subarray(0, Math.max(lost, 1))]));
}

// A car at a time: its channels, straight between recorded rows.
function stateAt(run, t) {
  const [i, part] = place(run.channels.time, t);
  const state = {index: i};
  for (const [name, values] of Object.entries(run.channels)) {
    state[name] = part > 0 ? between(name, values[i], values[i + 1], part) : values[i];
  }
  state.steer = state.steer_angle || 0;
  return state;
}

// An angle may leave its range at one end and come back at the other.
function between(channel, from, to, part) {
  const turn = 2 * Math.PI * Math.sign(to - from);
  if (channel !== 'sideslip' || Math.abs(to - from) <= Math.PI) return from + part * (to - from);
  const value = from + part * (to - turn - from);
  return Math.abs(value) > Math.PI ? value + turn : value;
}

// Where the wheels are, from the centre of mass, in vehicle axes (x forward, y left).
function wheelsOf(car) {
  const half = car.track / 2;
  return {
    fl: [car.front_axle, half], fr: [car.front_axle, -half],
    rl: [-car.rear_axle, half], rr: [-car.rear_axle, -half],
  };
}

function unwrapped(angles) {
  const whole = Float64Array.from(angles);
  for (let i = 1; i < whole.length; i++) {
    const turns = Math.round((whole[i] - whole[i - 1]) / (2 * Math.PI));
    if (turns) for (let k = i; k < whole.length; k++) whole[k] -= 2 * Math.PI * turns;
  }
  return whole;
}

// Length per force [m/N], the same for all wheels and runs: friction circles of an axle never overlap;
// without circles, no arrow is longer than half the track.
function forceScale(runs) {
  let largest = 0;
  for (const {channels, car} of runs) {
    const pairs = 'grip_fl' in channels ? [['grip_fl', 'grip_fr'], ['grip_rl', 'grip_rr']] : [];
    for (const [left, right] of pairs) {
      channels[left].forEach((one, i) => { const f = (one + channels[right][i]) / (0.96 * car.track); if (f > largest) largest = f; });
    }
    if (pairs.length || !('force_x_fl' in channels)) continue;
    for (const wheel of WHEELS) {
      channels['force_x_' + wheel].forEach((fx, i) => {
        const f = Math.hypot(fx, channels['force_y_' + wheel][i]) / (0.5 * car.track);
        if (f > largest) largest = f;
      });
    }
  }
  return largest > 0 ? 1 / largest : 0;
}

class Road {
  constructor(viewer) {
    Object.assign(this, {viewer, playing: false, rate: 1, view: {}});
    const find = viewer.find;
    Object.assign(this, {scene: find('scene'), buttons: viewer.root.querySelectorAll('.yv-play'), closeUps: find('closeups'), camera: find('camera')});
    this.cars = viewer.runs.filter((run) => run.road && run.road.x);
    for (const run of this.cars) {
      run.channels = channelsOf(run);
      Object.assign(run, run.road.outline, {ground: viewer.data.grounds[run.road.ground ?? -1] || []});
      run.laid = laid(run.lanes);
      const grips = WHEELS.map((wheel) => extremes(run.channels['grip_' + wheel] || [0])[1]);
      run.widest = Math.max(...grips, 0);
    }
    this.scale = forceScale(this.cars);
    this.strongest = Math.max(...this.cars.map((run) => {
      const [low, high] = extremes(run.channels.yaw_moment || [], [0, 0]);
      return Math.max(high, -low);
    }), 0);
    for (const button of this.buttons) button.addEventListener('click', () => this.toggle());
    find('rate').addEventListener('change', (event) => { this.rate = Number(event.target.value); });
    this.camera.addEventListener('change', (event) => {
      const chosen = event.target.value;
      viewer.state.camera = /^\d+$/.test(chosen) ? Number(chosen) : chosen;
      viewer.state.near = 1;
      this.draw();
      viewer.remember();
    });
    turnByDragging(this.scene, () => this.inSpace, (turn, rise) => {
      const {look} = viewer.state;
      viewer.state.look = [(look[0] + turn) % (2 * Math.PI), Math.min(Math.max(look[1] + rise, -1.5), 1.5)];
      this.draw();
      viewer.remember();
    });
    find('large').addEventListener('click', () => (document.fullscreenElement ? document.exitFullscreen() : find('road').requestFullscreen()));
    find('road').addEventListener('fullscreenchange', () => this.draw());
    find('nearer').addEventListener('click', () => this.zoom(1.25));
    find('farther').addEventListener('click', () => this.zoom(0.8));
  }

  zoom(factor) {
    const {state} = this.viewer;
    state.near = Math.min(Math.max(state.near * factor, ZOOM[0]), ZOOM[1]);
    this.draw();
    this.viewer.remember();
  }

  // One close-up per shown run, and the cameras to choose from.
  arrange() {
    const {viewer} = this;
    for (const run of this.cars) {
      run.channels.time = run.shifted.subarray(0, run.channels.x.length);
      [run.colour, run.dash] = [viewer.colour(run), viewer.dash(run)];
    }
    this.shown = this.cars.filter((run) => viewer.shows(run));
    this.view.lanes = [...new Map([...this.shown].reverse().map((run) => [run.lanes.join(), run])).values()]; // alike ones once
    this.closeUps.replaceChildren(...this.shown.map((run) => {
      const figure = made('figure', made('canvas', '', {role: 'img', ariaLabel: `Tyre forces of ${run.label}`}));
      const caption = made('figcaption', '', {innerHTML: viewer.swatch(run)});
      caption.append(` ${run.label}`);
      const early = run.notes.length || run.end > viewer.ends()[1] - 1e-6 ? [] : [`ends at ${run.end.toFixed(2)} s`];
      for (const note of [...run.notes, ...early]) caption.append(made('br'), made('em', note));
      figure.append(caption);
      return figure;
    }));
    const chosen = String(viewer.state.camera);
    const views = [['cars', this.shown.length > 1 ? 'all cars' : 'car'], ...(this.shown.length > 1 ? this.shown.map((run) => [String(run.number), run.label]) : []), ['whole', 'whole path'], ...CAMERAS.map((one) => [one, `3-D: ${SPACE[one].says}`])];
    this.camera.replaceChildren(...views.map(([value, words]) => new Option(words, value)));
    this.camera.value = views.some(([value]) => value === chosen) ? chosen : 'cars';
  }

  draw(density) {
    const {viewer} = this;
    useTheme(viewer.theme);
    const time = viewer.state.time;
    const states = this.shown.map((run) => stateAt(run, time));
    const chosen = this.camera.value;
    const index = this.shown.findIndex((run) => String(run.number) === chosen);
    this.view.camera = index >= 0 ? index : (chosen === 'whole' ? 'whole' : 'cars');
    this.view.zoom = viewer.state.near;
    this.states = states;
    this.inSpace = CAMERAS.includes(chosen) && this.shown.length > 0;
    this.scene.classList.toggle('yv-space', this.inSpace);
    this.scene.ariaLabel = this.inSpace ? `The cars in three dimensions, ${SPACE[chosen].says}` : 'The road from above';
    if (!this.shown.length) { surface(this.scene, density); return; }
    if (this.inSpace) {
      const {look, near} = viewer.state;
      const lead = Math.max(this.shown.indexOf(viewer.lead()), 0);
      drawSpace(this.scene, density, this.shown, states, {camera: chosen, lead, lanes: this.view.lanes, look, near, scale: this.scale, strongest: this.strongest, time});
    } else drawScene(this.scene, density, this.shown, states, this.view, this.scale);
    [...this.closeUps.querySelectorAll('canvas')].forEach((canvas, i) => {
      drawCloseUp(canvas, density, this.shown[i], i, states[i], this.scale, this.strongest);
    });
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    const {viewer} = this;
    const [start, end] = viewer.ends();
    if (!this.touched || viewer.state.time >= end) viewer.state.time = start;
    this.touched = true;
    this.playing = true;
    this.offer('Pause');
    let before = null;
    const next = (now) => {
      if (!this.playing) return;
      viewer.state.time = Math.min(viewer.state.time + (before === null ? 0 : ((now - before) / 1000) * this.rate), end);
      before = now;
      if (viewer.state.time >= end) this.pause();
      viewer.follow();
      viewer.moveCursor();
      if (this.playing) requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  pause() {
    this.playing = false;
    this.touched = true;
    this.offer('Play');
  }

  offer(words) { for (const button of this.buttons) button.textContent = words; }
}
