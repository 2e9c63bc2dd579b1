// A run as the page carries it: channels of 32-bit floats in base64, SI, one value per moment kept.

const WHEELS = ['fl', 'fr', 'rl', 'rr'];

function unpack(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

function unpackRun(run) {
  const channels = {};
  for (const [name, text] of Object.entries(run.channels)) channels[name] = unpack(text);
  const time = channels.time;
  const grips = WHEELS.map((wheel) => extremes(channels['grip_' + wheel] || [0])[1]);
  return {...run, channels, start: time[0], end: time[time.length - 1], widest: Math.max(...grips)};
}

// Index of the last moment at or before t, and how far t is on the way to the next.
function place(time, t) {
  let low = 0;
  let high = time.length - 1;
  if (t >= time[high]) return [high, 0];
  if (t <= time[0]) return [0, 0];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle; else high = middle;
  }
  return [low, (t - time[low]) / (time[high] - time[low])];
}

// All channels of a run at t, straight between the moments kept.
function stateAt(run, t) {
  const [i, part] = place(run.channels.time, t);
  const state = {index: i};
  for (const [name, values] of Object.entries(run.channels)) {
    state[name] = part > 0 ? between(name, values[i], values[i + 1], part) : values[i];
  }
  state.steer = state.steer_angle || 0;
  return state;
}

// Whether a step is that of an angle which leaves its range at one end and comes back at the other.
function turns(channel, step) {
  return channel === 'sideslip' && Math.abs(step) > Math.PI;
}

function between(channel, from, to, part) {
  const turn = 2 * Math.PI * Math.sign(to - from);
  if (!turns(channel, to - from)) return from + part * (to - from);
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

function decimal(value, decimals) {
  const shown = value.toFixed(decimals);
  return Number(shown) === 0 ? shown.replace('-', '') : shown.replace('-', '−');
}

function extremes(values, from = [Infinity, -Infinity]) {
  let [low, high] = from;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}
