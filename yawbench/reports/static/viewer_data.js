// Recorded runs as the page carries them (`viewer_samples.py` packs them), and values at a time.

// Start a part of the page when all of it, and all scripts, have been read.
function ready(start) {
  if (document.readyState === 'loading') document.addEventListener('DOMContentLoaded', start);
  else queueMicrotask(start);
}

// An element with a text, or another element, in it, and properties.
function made(tag, content = '', properties = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  if (content !== '') element.append(content);
  return element;
}

// What an axis shows, with its unit.
function inUnit({label, unit}) { return unit ? `${label} in ${unit}` : label; }

const WHEELS = ['fl', 'fr', 'rl', 'rr'];

const NOT_FINITE = [NaN, -Infinity, Infinity];

function decoded([offset, base, step], rows, bytes) {
  const values = new Float64Array(rows);
  const [low, middle, high, highest] = [0, 1, 2, 3].map((k) => bytes.subarray(offset + k * rows, offset + (k + 1) * rows));
  for (let i = 0, code = 0, slope = 0; i < rows; i++) {
    const folded = low[i] | (middle[i] << 8) | (high[i] << 16) | (highest[i] << 24);
    slope = (slope + ((folded >>> 1) ^ -(folded & 1))) | 0;
    code = (code + slope) | 0;
    values[i] = code < 0 ? NOT_FINITE[-1 - code] : base + code * step;
  }
  return values;
}

// Index of the last row at or before t, and the way from there to the next row, 0 to 1.
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

// The signals of a sum or difference.
function partsOf(name) { return name.split(/ [-+] /); }

class Run {
  constructor(described, bytes, number) {
    Object.assign(this, described, {number});
    this.bytes = bytes;
    this.time = decoded(described.time, described.rows, bytes);
    this.start = this.time[0];
    this.end = this.time[this.time.length - 1];
    this.decoded = new Map();
  }

  has(name) { return partsOf(name).every((part) => part in this.columns); }

  // A recorded signal, or the sum and difference `a + b - c` of several.
  column(name) {
    if (!this.decoded.has(name)) this.decoded.set(name, this.decode(name));
    return this.decoded.get(name);
  }

  decode(name) {
    const [first, ...rest] = name.split(/ ([-+]) /);
    if (!rest.length) return decoded(this.columns[name], this.rows, this.bytes);
    const sum = Float64Array.from(this.column(first));
    for (let k = 0; k < rest.length; k += 2) {
      const [sign, values] = [rest[k] === '-' ? -1 : 1, this.column(rest[k + 1])];
      for (let i = 0; i < sum.length; i++) sum[i] += sign * values[i];
    }
    return sum;
  }

  // Values of a signal that lie closer to each other than this mean the same: the steps of their codes.
  grain(name) { return partsOf(name).reduce((sum, part) => sum + this.columns[part][2], 0); }

  // The recorded value at t, of the nearest row; NaN where the run has none.
  at(name, t) {
    if (!this.has(name) || t < this.start - 1e-9 || t > this.end + 1e-9) return NaN;
    const [row, part] = place(this.time, t);
    return this.column(name)[part > 0.5 ? row + 1 : row];
  }

  // Distance travelled, from the position or the speed; null where neither was recorded.
  get distance() {
    if (this.travelled !== undefined) return this.travelled;
    const road = this.road || {};
    const total = new Float64Array(this.rows);
    if (road.x) {
      const [x, y] = [this.column(road.x), this.column(road.y)];
      for (let i = 1; i < this.rows; i++) total[i] = total[i - 1] + Math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]);
      this.travelled = total;
    } else if (road.velocity_x) {
      const speed = this.column(road.velocity_x);
      for (let i = 1; i < this.rows; i++) {
        total[i] = total[i - 1] + 0.5 * (speed[i] + speed[i - 1]) * (this.time[i] - this.time[i - 1]);
      }
      this.travelled = total;
    } else this.travelled = null;
    return this.travelled;
  }
}

// Values of a run at the times of another run, straight between rows, NaN outside.
function resampled(values, time, wanted) {
  if (time.length === wanted.length && time[0] === wanted[0] && time[time.length - 1] === wanted[wanted.length - 1]) return values;
  return Float64Array.from(wanted, (t) => {
    if (t < time[0] - 1e-9 || t > time[time.length - 1] + 1e-9) return NaN;
    const [i, part] = place(time, t);
    return part > 0 ? values[i] + part * (values[i + 1] - values[i]) : values[i];
  });
}

function extremes(values, from = [Infinity, -Infinity]) {
  let [low, high] = from;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

// A number with some significant digits, as `figures/display.digits_of` writes it.
function digitsOf(value, digits) {
  if (Number.isNaN(value)) return 'no number';
  if (!Number.isFinite(value)) return value > 0 ? 'never' : '-∞';
  if (value === 0) return '0';
  const rounded = Number(value.toExponential(digits - 1));
  const decimals = digits - 1 - Math.floor(Math.log10(Math.abs(rounded)));
  if (decimals > 6 || Math.abs(value) >= 1e15) return value.toExponential(digits - 1).replace(/e([+-])(\d)$/, 'e$10$2');
  return value.toFixed(Math.max(decimals, 0));
}

// The same with no digits finer than a grain: 0.000 for what cannot be told from zero.
function knownDigits(value, digits, grain) {
  if (!(grain > 0 && grain < Infinity) || !Number.isFinite(value) || value === 0) return digitsOf(value, digits);
  const power = Math.ceil(Math.log10(grain) - 1e-9); // of the last digit that is known
  if (Math.min(Math.floor(Math.log10(Math.abs(value))) - digits + 1, 0) >= power) return digitsOf(value, digits);
  const known = Math.round(value / 10 ** power) * 10 ** power;
  return Object.is(known, -0) || known === 0 ? (0).toFixed(Math.max(-power, 0)) : known.toFixed(Math.max(-power, 0));
}

function decimal(value, decimals) {
  const shown = value.toFixed(decimals);
  return Number(shown) === 0 ? shown.replace('-', '') : shown.replace('-', '−');
}
