// The viewer: run table, bar, panels with one axis and one cursor, the road from above. Its state is the
// fragment of the page's address, so that a link shows the same picture.

const ZOOM = [0.1, 8];
const FEW = 40; // runs listed at once, besides those shown; chosen: more do not fit on a screen
const NAMED = 4; // signals that a message names; chosen: a line
const LONGEST_NAME = 150; // of a file, in characters; chosen: well below what file systems take
const PAPER = 3; // dots per pixel in print
const plotters = new Map(); // dots per pixel -> uPlot, which takes them once, when it is made

function plotter(ratio) {
  if (!plotters.has(ratio)) plotters.set(ratio, makeUPlot(ratio));
  return plotters.get(ratio);
}

// The fragment that the parts of the page have heard of; a link sets another one before `hashchange` tells them.
let heard = location.hash;
addEventListener('hashchange', () => { heard = location.hash; });

// The fragment of the address is the state of each part of the page: key?name=value&&key?...; null: it says nothing.
function readAddress(key) {
  const own = location.hash.slice(1).split('&&').find((part) => part.startsWith(key + '?'));
  return own === undefined ? null : new URLSearchParams(own.slice(key.length + 1));
}

// Every step that can be undone is an entry of the browser's history, with its number.
let depth = history.state?.depth ?? 0;
let followed = false; // whether the address is that of a link just followed, which says nothing of the other parts
history.replaceState({depth}, '');
addEventListener('hashchange', () => {
  const {state} = history;
  followed = !state;
  if (!state) history.replaceState({depth: depth + 1, link: !location.hash.includes('?')}, ''); // a link of the page
  depth = history.state.depth;
});

// Write the state of a part of the page into the address, as a step that Back undoes or in place of the one before, and
// return the fragment; not over a link just followed.
function writeAddress(key, words, step = false) {
  if (location.hash !== heard) return null;
  const others = location.hash.slice(1).split('&&').filter((part) => part.includes('?') && !part.startsWith(key + '?'));
  const all = [...others, ...(words.size || others.length || location.hash.includes('?') ? [`${key}?${words}`] : [])];
  const written = '#' + all.join('&&');
  if (all.length && location.hash !== written) {
    if (step) history.pushState({depth: ++depth}, '', written); else history.replaceState(history.state, '', written);
  }
  heard = location.hash;
  return written;
}

// Level of a heading at a place of the page: one below the last heading before it.
function headingLevel(place) {
  const before = [...document.querySelectorAll('h1, h2, h3, h4')].filter((one) => !one.closest('.yv') && one.checkVisibility()
    && one.compareDocumentPosition(place) === Node.DOCUMENT_POSITION_FOLLOWING);
  const last = before.at(-1);
  return last ? Number(last.getAttribute('aria-level') ?? last.tagName[1]) + 1 : 2;
}

// A part of the page whose state is in the address under its `key`. `initial()` returns the state without one;
// `kinds()`, by name, what tells whether a value can be taken over. What changes but the time is a step for Back.
class InAddress {
  remember(plain = this.initial()) {
    const words = new URLSearchParams();
    for (const [name, value] of Object.entries(this.state)) {
      if (JSON.stringify(value) === JSON.stringify(plain[name])) continue;
      words.set(name, JSON.stringify(name === 'time' ? Number(value.toFixed(6)) : value));
    }
    const lasting = this.lasts();
    this.written = writeAddress(this.key, words, lasting !== (this.lasting ?? lasting));
    this.lasting = lasting;
  }

  lasts() { return JSON.stringify({...this.state, time: 0}); }

  // Take over what the address says; return whether it says anything about this part. Back to an address that says
  // nothing is back to the beginning.
  restore() {
    if (location.hash === this.written) return false;
    const own = readAddress(this.key) ?? (this.lasting === undefined || followed || history.state?.link ? null : new URLSearchParams());
    if (!own) { this.lasting ??= this.lasts(); return false; }
    const [state, kinds] = [this.initial(), this.kinds()];
    for (const [name, text] of own) {
      let value;
      try { value = JSON.parse(text); } catch { continue; }
      if (Object.hasOwn(kinds, name) && kinds[name](value)) Object.assign(state, {[name]: value}, this.implied(name, value));
    }
    this.state = state;
    this.written = location.hash;
    this.lasting = this.lasts();
    return true;
  }

  // What a value of the address sets besides itself.
  implied() { return {}; }
}

class Viewer extends InAddress {
  constructor(root, data, runs) {
    super();
    Object.assign(this, {root, data, runs, listeners: new Set(), density: undefined});
    this.find = (name) => root.querySelector('.yv-' + name);
    this.key = root.id;
    this.fill();
    this.state = this.initial();
    this.restore();
    this.shift();
    this.panels = [];
    this.axis = new Axis(this);
    this.removal = new AbortController();
    this.listen();
    this.road = null;
    this.level = headingLevel(root);
    this.refresh(undefined, 1); // the first curves at once
    requestAnimationFrame(() => setTimeout(() => this.complete()));
    const {signal} = this.removal;
    window.addEventListener('hashchange', () => {
      if (!this.restore()) return;
      this.refresh();
      root.scrollIntoView({block: 'nearest'});
    }, {signal});
    this.observer = new ResizeObserver(() => this.resized());
    this.observer.observe(root);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.refresh(), {signal});
    addEventListener('beforeprint', () => this.print(), {signal});
    addEventListener('afterprint', () => this.print(false), {signal});
  }

  // Draw the other panels, and the road.
  complete() {
    if (this.removal.signal.aborted) return;
    this.drawPanels(1);
    if (this.runs.some((run) => run.road)) {
      this.road = new Road(this);
      this.road.arrange();
      this.subscribe(() => this.road.draw(this.density));
    }
    this.events = new Events(this);
    this.root.classList.add('yv-ready');
  }

  // Stop listening, before another viewer takes its place.
  remove() {
    clearTimeout(this.later);
    this.remember();
    if (this.road) this.road.pause();
    this.removal.abort();
    this.observer.disconnect();
  }

  // Call `listener`, now and whenever any of it changes, with {time, shown, colours}: the cursor's time in s, the shown
  // runs (`Run`, in the order of the table), and the colour of each. Return a function that ends it.
  subscribe(listener) {
    this.listeners.add(listener);
    listener(this.news);
    return () => this.listeners.delete(listener);
  }

  get news() {
    const shown = this.runs.filter((run) => this.shows(run));
    return {time: this.state.time, shown, colours: shown.map((run) => this.colour(run))};
  }

  // What depends on the runs: their table, the views and signals to choose from, the legend.
  fill() {
    const {data, find, key} = this;
    const several = data.runs.length > 1;
    const head = find('runs').tHead.rows[0];
    if (several) head.append(made('th', 'baseline', {scope: 'col', id: `${key}-baseline`}));
    const measured = data.runs.some((run) => run.dash);
    if (measured) head.append(made('th', 'offset in s', {scope: 'col', id: `${key}-offset`}));
    for (const [title] of data.metrics) head.append(made('th', title, {scope: 'col', className: 'yv-metric'}));
    this.rowOf = (k) => {
      const run = data.runs[k];
      const row = made('tr');
      row.dataset.run = k;
      const label = made('label', made('input', '', {type: 'checkbox', className: 'yv-show'}));
      label.append(' ', made('span', '', {className: 'yv-swatch'}), ' ', made('span', run.label, {id: `${key}-run-${k}`, className: 'yv-label'}));
      row.append(made('th', label, {scope: 'row'}));
      if (several) {
        const base = made('input', '', {type: 'radio', className: 'yv-base', name: `${key}-baseline`});
        base.setAttribute('aria-labelledby', `${key}-run-${k} ${key}-baseline`);
        row.append(made('td', base));
      }
      if (measured) {
        const offset = made('input', '', {type: 'number', step: 'any', className: 'yv-offset'});
        offset.setAttribute('aria-labelledby', `${key}-run-${k} ${key}-offset`);
        row.append(run.dash ? made('td', offset) : made('td'));
      }
      for (const [, values] of data.metrics) {
        const [value, remark] = (values[k] || '–').split(', ');
        const cell = made('td', value, {className: 'yv-metric'});
        if (remark) cell.append(made('small', remark));
        row.append(cell);
      }
      return row;
    };
    find('rest').hidden = data.runs.length <= FEW;
    find('rest').textContent = `All ${data.runs.length} runs`;
    find('views').append(...data.views.map((view, k) => new Option(view.title, k)));
    find('choice').hidden = data.views.length < 2;
    for (const one of this.root.querySelectorAll('.yv-several')) one.hidden = !several;
    find('partial').hidden = !data.partial;
    find('key').textContent = data.key;
    const names = Object.entries(data.signals);
    find('add').placeholder = `${names.length} ${data.partial ? 'here' : 'recorded'}`;
    find('add').list.append(...names.map(([name, {label}]) => made('option', label, {value: name})));
    if (data.runs.some((run) => run.road)) return;
    find('main').classList.add('yv-alone');
    for (const one of this.root.querySelectorAll('.yv-play')) one.remove();
    find('road').remove();
  }

  initial() {
    return {
      view: 0, ...this.viewed(0), span: null, heights: {}, tall: [], time: this.data.still, pin: null, lit: null,
      difference: false, tolerance: 0, camera: 'cars', look: [0, 0], near: 1, offsets: {...this.data.offsets},
    };
  }

  // Runs, baseline and panels of a view.
  viewed(number) {
    const {shown, panels, x} = this.data.views[number];
    return {shown: [...shown], baseline: shown[0] || 0, panels: [...panels], x};
  }

  // ---- the address ----

  remember() { super.remember({...this.initial(), ...this.viewed(this.state.view)}); }

  kinds() {
    const isRun = (v) => Number.isInteger(v) && v in this.runs;
    const isSpan = (v) => Array.isArray(v) && v.length === 2 && v.every(Number.isFinite) && v[0] < v[1];
    const isRecord = (v) => v && typeof v === 'object' && !Array.isArray(v);
    return {
      view: (v) => Number.isInteger(v) && v in this.data.views,
      shown: (v) => Array.isArray(v) && v.every(isRun),
      baseline: isRun,
      panels: (v) => Array.isArray(v) && v.every((n) => typeof n === 'string' && this.known(n)),
      span: (v) => v === null || isSpan(v),
      heights: (v) => isRecord(v) && Object.values(v).every(isSpan), tall: (v) => Array.isArray(v) && v.every((one) => typeof one === 'string'),
      pin: (v) => v === null || Number.isFinite(v),
      lit: (v) => v === null || (Array.isArray(v) && v.length === 3 && typeof v[0] === 'string' && (v[1] === null || Number.isFinite(v[1])) && typeof v[2] === 'string'),
      time: Number.isFinite, difference: (v) => typeof v === 'boolean', tolerance: (v) => Number.isFinite(v) && v >= 0,
      x: (v) => this.axes().includes(v), camera: (v) => ['cars', 'whole', ...CAMERAS].includes(v) || isRun(v),
      look: (v) => Array.isArray(v) && v.length === 2 && v.every(Number.isFinite),
      near: (v) => v >= ZOOM[0] && v <= ZOOM[1],
      offsets: (v) => isRecord(v) && Object.values(v).every(Number.isFinite),
    };
  }

  implied(name, value) {
    if (name === 'view') return this.viewed(value);
    return {};
  }

  // What a claim judges (`lit`: its signal, its bound, its words) has the first panel; the cursor goes to its peak.
  restore() {
    if (!super.restore()) return false;
    const {lit} = this.state;
    if (!lit || !this.known(lit[0]) || readAddress(this.key)?.has('time')) return true;
    const own = this.state.panels.find((spec) => spec.split(',').includes(lit[0])) ?? lit[0];
    this.state.panels = [own, ...this.state.panels.filter((spec) => spec !== own)];
    const run = this.lead();
    if (run.has(lit[0])) {
      const size = run.column(lit[0]).map((value) => (Number.isFinite(value) ? Math.abs(value) : 0));
      this.state.time = run.time[size.indexOf(extremes(size)[1])] + this.offset(run.number);
    }
    return true;
  }

  // ---- runs ----

  shift() {
    for (const run of this.runs) {
      const by = this.offset(run.number);
      run.shifted = by ? run.time.map((t) => t + by) : run.time;
    }
  }

  offset(number) { return this.state.offsets[number] || 0; }

  shows(run) { return this.state.shown.includes(run.number); }

  get baseline() { return this.runs[this.state.baseline]; }

  // The run that the cursor follows where the axis is not time.
  lead() { return this.shows(this.baseline) ? this.baseline : this.runs.find((run) => this.shows(run)) || this.baseline; }

  // Number of a run's line style: its own while there are enough, else its place among the shown.
  style(run) {
    const styles = this.data.dashes.length;
    if (this.runs.length <= styles) return run.number;
    return Math.max(this.state.shown.indexOf(run.number), 0) % styles;
  }

  colour(run) {
    if (run.band) return this.theme.pale;
    const colour = this.theme.runs[this.style(run)];
    return run.ghost ? colour + (colour.length === 4 ? '7' : '73') : colour; // a hexadecimal alpha
  }

  // A run's colour for what is drawn behind its line.
  faint(run) {
    const colour = this.theme.runs[this.style(run)];
    return colour + (colour.length === 4 ? '5' : '59');
  }

  dash(run) { return run.dash || this.data.dashes[this.style(run)]; }

  meaning(name) {
    const [first, ...rest] = name.split(/ ([-+]) /);
    const one = this.data.signals[first];
    if (!one) return {label: name, unit: '', factor: 1};
    if (name.endsWith(` - ${rest[1]}`) && rest[1].endsWith(`${first.replace(/^.*\./, '')}_ref`)) return {...one, label: `${one.label}, error`};
    const words = rest.map((part) => ({'-': 'minus', '+': 'plus'}[part] ?? this.data.signals[part].label.toLowerCase()));
    return {...one, label: [one.label, ...words].join(' ')};
  }

  // A piece of a run's line; `reference`: the colour of its reference, which is wide.
  swatch(run, reference = '') {
    const dash = this.dash(run).map((part) => (2.2 * part).toFixed(1)).join(' ');
    const stroke = reference || (this.shows(run) ? this.colour(run) : this.theme.pale);
    return `<svg width="30" height="10" aria-hidden="true"><line x1="1" y1="5" x2="29" y2="5" stroke="${stroke}" `
      + `stroke-width="${reference ? 5 : 2.2}"${dash && !reference ? ` stroke-dasharray="${dash}"` : ''}/></svg>`;
  }

  // Whether instants and limits of a run, or of all runs, are drawn: only while it, or any, is shown.
  tells(run) { return run === null ? this.state.shown.length > 0 : this.state.shown.includes(run); }

  // Limit curves of the plane of the horizontal axis and a signal, as [text, x in shown units, y in SI].
  curves(name) {
    if (!this.portrait || this.state.difference) return [];
    const {factor} = this.data.signals[this.state.x];
    return this.data.curves.filter(([x, y, , , , run]) => x === this.state.x && y === name && this.tells(run))
      .map(([, , says, xs, ys]) => [says, xs.map((value) => value * factor), ys]);
  }

  get portrait() { return this.state.x in this.data.signals; }

  faults() { return this.runs.filter((run) => this.shows(run)).flatMap((run) => run.faults); }

  // The runs that are drawn; of differences, without the baseline.
  drawnRuns() { return this.runs.filter((run) => this.shows(run) && !(this.state.difference && run === this.baseline)); }

  drawnLabel(run) { return this.state.difference ? `${run.label} minus ${this.baseline.label}` : run.label; }

  // What is drawn instead of the runs themselves: `B minus A`; '' if they are.
  get drawnInstead() {
    if (!this.state.difference) return '';
    return `${this.drawnRuns().map((run) => run.label).join(', ') || 'nothing'} minus ${this.baseline.label}`;
  }

  fromBaseline(run, name) {
    const from = resampled(this.baseline.column(name), this.baseline.shifted, run.shifted);
    return run.column(name).map((value, i) => value - from[i]);
  }

  // See `Run.grain`.
  grain(run, name) {
    return run.grain(name) + (this.state.difference && run !== this.baseline ? this.baseline.grain(name) : 0);
  }

  // The signals of a text of the reader, by name, by variable, by label or by words of these, as a panel names them.
  // Throw a sentence for the reader if there are none or several.
  named(text) {
    const signal = (part) => (/^ [-+] $/.test(part) ? part : this.signalOf(part.trim()));
    return text.split(',').map((spec) => spec.trim().split(/( [-+] )/).map(signal).join('')).join(',');
  }

  signalOf(text) {
    const {signals, partial} = this.data;
    if (text in signals) return text;
    const wanted = text.toLowerCase();
    const told = Object.entries(signals).map(([name, signal]) => ({
      name, says: [name, name.slice(name.indexOf('.') + 1), ...signal.fed ?? [], signal.label, inUnit(signal)].map((one) => one.toLowerCase()),
    }));
    const words = wanted.split(/[^\p{L}\p{N}]+/u).filter(Boolean);
    const share = ({says}) => words.filter((word) => says.some((one) => one.includes(word))).length;
    const whole = told.filter(({says}) => says.includes(wanted));
    const most = Math.max(...told.map(share), 1);
    const found = whole.length ? whole : told.filter((one) => share(one) === most);
    const sure = whole.length || most === words.length;
    if (found.length === 1 && sure) return found[0].name;
    const names = found.slice(0, NAMED).map(({name}) => name).join(', ') + (found.length > NAMED ? ` and ${found.length - NAMED} more` : '');
    if (sure && found.length) throw new Error(`${text} may be ${names}`);
    const where = partial ? '; yawbench plot --page shows all that was recorded' : '';
    throw new Error(`${partial ? `this page has no signal ${text}` : `no signal ${text} was recorded`}${names ? `; near are ${names}` : ''}${where}`);
  }

  known(spec) { return spec.split(',').every((name) => partsOf(name.trim()).every((part) => part in this.data.signals)); }

  // ---- the horizontal axis ----

  axes() { return ['time', ...(this.runs.some((run) => run.distance) ? ['distance'] : []), ...Object.keys(this.data.signals)]; }

  horizontal(run) {
    const {x} = this.state;
    if (x === 'time') return run.shifted;
    if (x === 'distance') return run.distance || new Float64Array(run.rows).fill(NaN);
    if (!run.has(x)) return new Float64Array(run.rows).fill(NaN);
    const {factor} = this.data.signals[x];
    return run.column(x).map((value) => value * factor);
  }

  get axisLabel() {
    const {x} = this.state;
    if (x === 'time') return 't in s';
    if (x === 'distance') return 'distance in m';
    return inUnit(this.data.signals[x]);
  }

  whole() {
    let range = [Infinity, -Infinity];
    for (const run of this.runs) if (this.shows(run)) range = extremes(this.horizontal(run), range);
    for (const [, xs] of this.state.panels.flatMap((spec) => this.curves(spec))) if (xs[0] === xs.at(-1)) range = extremes(xs, range); // closed
    if (!(range[0] <= range[1])) return [0, 1];
    if (this.state.x !== 'time' && this.state.x !== 'distance') {
      const room = 0.04 * (range[1] - range[0]) || 1;
      return [range[0] - room, range[1] + room];
    }
    return range[0] < range[1] ? range : [range[0], range[0] + 1];
  }

  span() { return this.state.span || this.whole(); }

  zoomTo(span) {
    const [low, high] = this.whole();
    if (span && !(span[1] - span[0] > 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1))) return;
    this.state.span = span && (span[0] > low || span[1] < high) ? span : null;
    for (const chart of [...this.panels, this.axis]) chart.zoom();
    this.moveCursor();
  }

  // Show a span of a width, within the whole.
  panTo(from, wide) {
    const [low, high] = this.whole();
    const width = Math.min(wide, high - low);
    const begin = Math.min(Math.max(from, low), high - width);
    this.zoomTo([begin, begin + width]);
  }

  // Show values of a panel from one to another, in shown units.
  setHeights(spec, [low, high]) {
    if (!(high - low > 1e-12 * Math.max(Math.abs(low), Math.abs(high), 1e-9))) return;
    this.state.heights = {...this.state.heights, [spec]: [low, high]};
    this.panels.find((panel) => panel.spec === spec)?.zoom();
    this.moveCursor();
  }

  showWhole() {
    this.state.heights = {};
    this.zoomTo(null);
  }

  zoom(factor, around) {
    const [from, to] = this.span();
    const middle = around ?? (this.state.x === 'time' && this.state.time >= from && this.state.time <= to ? this.state.time : (from + to) / 2);
    const [low, high] = this.whole();
    const span = [middle - (middle - from) / factor, middle + (to - middle) / factor];
    this.zoomTo([Math.max(span[0], low), Math.min(span[1], high)]);
  }

  // ---- the cursor ----

  pointAt(panel, left, top) {
    const value = panel.plot.posToVal(left, 'x');
    if (this.state.x === 'time') { this.seek(value, true); return; }
    const lead = this.lead();
    const xs = this.horizontal(lead);
    const ys = panel.shown.find((line) => line.run === lead);
    let [best, least] = [0, Infinity];
    const wide = panel.plot.over.clientWidth;
    const [from, to] = this.span();
    for (let i = 0; i < xs.length; i++) {
      const across = ((xs[i] - value) / (to - from)) * wide;
      const up = ys && this.state.x !== 'distance' ? panel.plot.valToPos(ys.values[i] * panel.meaning.factor, 'y') - top : 0;
      const far = across * across + up * up;
      if (far < least) [best, least] = [i, far];
    }
    this.seek(lead.shifted[best], true);
  }

  ends() {
    const shown = this.runs.filter((run) => this.shows(run));
    const all = shown.length ? shown : this.runs;
    return [Math.min(...all.map((run) => run.shifted[0])), Math.max(...all.map((run) => run.shifted[run.rows - 1]))];
  }

  seek(time, hovering = false) {
    if (!hovering && this.road) this.road.pause();
    const [start, end] = this.ends();
    this.state.time = Math.min(Math.max(time, start), end);
    if (!hovering) this.follow();
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (!this.removal.signal.aborted) this.moveCursor();
    });
  }

  // Move a zoomed span along with a cursor that leaves it.
  follow() {
    const {span, time, x} = this.state;
    if (!span || x !== 'time' || (time >= span[0] && time <= span[1])) return;
    this.panTo(time - (span[1] - span[0]) / 2, span[1] - span[0]);
  }

  // Go to an instant of a run, and show the run.
  goTo(time, number) {
    if (!this.state.shown.includes(number)) this.showRuns([...this.state.shown, number], this.state.baseline);
    this.seek(time + this.offset(number));
  }

  setPin(on = this.state.pin === null) {
    this.state.pin = on ? this.state.time : null;
    this.refresh();
  }

  moveCursor() {
    for (const panel of this.panels) panel.moveCursor();
    const words = `${this.state.time.toFixed(3)} s`;
    const {pin, time} = this.state;
    this.find('clock').textContent = words;
    this.find('since').textContent = pin === null ? '' : `${decimal(time - pin, 3)} s since ${pin.toFixed(3)} s`;
    const slider = this.find('slider');
    slider.value = this.state.time;
    slider.setAttribute('aria-valuetext', words);
    this.tell();
    clearTimeout(this.later);
    this.later = setTimeout(() => this.remember(), 200);
  }

  tell() {
    const {news} = this;
    for (const listener of this.listeners) listener(news);
  }

  get step() {
    const lead = this.lead();
    return lead.rows > 1 ? (lead.end - lead.start) / (lead.rows - 1) : 1;
  }

  // ---- drawing ----

  readTheme() {
    const style = getComputedStyle(this.root);
    const value = (name) => style.getPropertyValue('--yv-' + name).trim();
    this.theme = {runs: [0, 1, 2, 3, 4, 5, 6].map((k) => value(`run-${k}`))};
    for (const name of ['ink', 'quiet', 'line', 'pale', 'faulty', 'mark', 'ground', 'lane', 'band']) this.theme[name] = value(name);
  }

  refresh(ratio = devicePixelRatio || 1, most = Infinity) {
    this.Plot = plotter(ratio);
    this.readTheme();
    this.shift();
    this.drawTable();
    this.tellMissing();
    const holder = this.find('panels');
    this.panels = this.state.panels.map((spec) => new Panel(this, spec));
    this.root.classList.toggle('yv-pinned', this.state.pin !== null);
    this.find('pin').setAttribute('aria-pressed', this.state.pin !== null);
    this.find('undo').disabled = !depth;
    holder.replaceChildren(...this.panels.map((panel) => panel.root));
    this.find('difference').checked = this.state.difference;
    this.find('tolerance').value = this.state.tolerance || '';
    this.find('x').value = this.state.x;
    this.find('views').value = this.state.view;
    const slider = this.find('slider');
    [slider.min, slider.max] = this.ends();
    slider.step = 'any';
    if (this.road) this.road.arrange();
    this.redraw(most);
  }

  redraw(most = Infinity) {
    this.wide = this.root.clientWidth; // before: drawn panels may bring a scroll bar, and then another width
    this.axis.draw(this.axis.chart.clientWidth);
    this.drawPanels(0, most);
    this.moveCursor();
  }

  drawPanels(first, most = Infinity) {
    const wide = this.panels[first]?.chart.clientWidth; // of all: asked for once, as it makes the browser lay out
    for (const panel of this.panels.slice(first, most)) panel.draw(wide);
  }

  resized() {
    if (this.root.classList.contains('yv-print')) return;
    if (this.root.clientWidth !== this.wide) this.redraw(); else this.tell();
  }

  print(printing = true) {
    this.root.classList.toggle('yv-print', printing);
    this.density = printing ? PAPER : undefined;
    this.refresh(this.density);
  }

  drawTable() {
    const table = this.find('runs');
    const body = table.tBodies[0];
    const listed = new Set([...body.rows].map((row) => Number(row.dataset.run)));
    this.runs.forEach((run, k) => {
      if (listed.has(k) || !(this.listsAll || k < FEW || this.shows(run) || this.baseline === run)) return;
      const next = [...body.rows].find((row) => Number(row.dataset.run) > k);
      body.insertBefore(this.rowOf(k), next || null);
    });
    for (const row of body.rows) {
      const k = Number(row.dataset.run);
      row.querySelector('.yv-show').checked = this.shows(this.runs[k]);
      row.querySelector('.yv-label').textContent = this.runs[k] === this.baseline ? this.runs[k].label : this.drawnLabel(this.runs[k]);
      const base = row.querySelector('.yv-base');
      if (base) base.checked = this.state.baseline === k;
      row.querySelector('.yv-swatch').innerHTML = this.shows(this.runs[k]) ? this.swatch(this.runs[k]) : '';
      const offset = row.querySelector('.yv-offset');
      if (offset) offset.value = this.state.offsets[k] || '';
    }
    const first = body.querySelector(`[data-run="${Math.min(...this.state.shown)}"]`);
    if (first) table.parentElement.scrollTop = first.offsetTop - table.tHead.offsetHeight;
  }

  // ---- what the reader does ----

  listen() {
    this.find('rest').addEventListener('click', () => {
      this.listsAll = this.find('rest').hidden = true;
      this.drawTable();
    });
    this.find('runs').addEventListener('change', (event) => {
      const row = event.target.closest('tr');
      const number = Number(row.dataset.run);
      const {classList, value, checked} = event.target;
      if (classList.contains('yv-show')) {
        this.state.shown = this.runs.map((run) => run.number).filter((n) => (n === number ? checked : this.state.shown.includes(n)));
      } else if (classList.contains('yv-base')) {
        this.state.baseline = number;
      } else if (classList.contains('yv-offset')) {
        const by = Number(value);
        if (Number.isFinite(by) && by) this.state.offsets[number] = by; else delete this.state.offsets[number];
      }
      this.refresh();
    });
    this.find('views').addEventListener('change', (event) => {
      const view = Number(event.target.value);
      Object.assign(this.state, {view, span: null}, this.viewed(view));
      this.refresh();
    });
    const add = this.find('add');
    add.addEventListener('change', () => {
      this.taking(add, () => {
        const spec = add.value.trim() && this.named(add.value);
        if (!spec) return;
        if (!this.state.panels.includes(spec)) this.state.panels.push(spec);
        add.value = '';
        this.refresh();
        this.panels[this.state.panels.indexOf(spec)].root.scrollIntoView({block: 'center'});
      });
    });
    this.find('x').addEventListener('change', (event) => {
      this.taking(event.target, () => {
        const wanted = event.target.value.trim() || 'time';
        const axis = this.axes().includes(wanted) ? wanted : this.signalOf(wanted);
        [this.state.x, this.state.span] = [axis, null];
        this.refresh();
      });
    });
    this.find('difference').addEventListener('change', (event) => this.setDifference(event.target.checked));
    this.find('tolerance').addEventListener('change', (event) => {
      this.state.tolerance = Math.max(Number(event.target.value) || 0, 0);
      if (this.state.tolerance) this.state.difference = true;
      this.refresh();
    });
    const clicked = {
      all: () => this.showWhole(), pin: () => this.setPin(), undo: () => this.undo(), reset: () => this.reset(), in: () => this.zoom(1.6), out: () => this.zoom(1 / 1.6),
      csv: () => saveFile(new Blob([this.csv()], {type: 'text/csv'}), this.fileName('csv')),
      png: () => this.picture().toBlob((blob) => saveFile(blob, this.fileName('png'))),
      svg: () => saveFile(new Blob([this.drawing()], {type: 'image/svg+xml'}), this.fileName('svg')),
      link: ({target}) => { this.remember(); copyAddress(target); },
    };
    for (const [name, act] of Object.entries(clicked)) this.find(name).addEventListener('click', act);
    this.find('more').addEventListener('toggle', () => this.tellCommand());
    this.find('slider').addEventListener('input', (event) => this.seek(Number(event.target.value)));
    const keys = this.data.alone ? document : this.root; // several viewers of a page: the one with the focus
    keys.addEventListener('keydown', (event) => this.pressed(event), {signal: this.removal.signal});
  }

  // Take over what a field says, or tell the reader beside it why not.
  taking(field, take) {
    let problem = '';
    try { take(); } catch (error) { problem = error.message; }
    field.setCustomValidity(problem);
    field.reportValidity();
  }

  // A claim may judge a signal that the page does not carry: which, and where it is.
  tellMissing() {
    const {lit} = this.state;
    const place = this.find('missing');
    place.hidden = !lit || this.known(lit[0]);
    if (place.hidden) return;
    const command = plotOf(this.runs.filter((run) => this.shows(run)), ['--page', '--panel', lit[0]]);
    place.replaceChildren(`Judged: ${lit[2]}. This page does not carry ${lit[0]}${command ? '; it is in the page of ' : ''}`, ...(command ? [made('code', command)] : []), '.');
  }

  // The command that draws what is shown.
  tellCommand() {
    const command = commandOf(this);
    this.find('command').textContent = command;
    this.find('told').hidden = !command;
  }

  // The view on a canvas, and as SVG.
  picture() { return canvasOf(this); }

  drawing() { return svgOf(this); }

  undo() {
    this.remember();
    if (depth) history.back();
  }

  reset() {
    this.state = {...this.initial(), time: this.state.time};
    this.refresh();
  }

  showRuns(shown, baseline) {
    Object.assign(this.state, {shown: [...new Set(shown)].sort((one, other) => one - other), baseline});
    this.refresh();
  }

  setDifference(on) {
    this.state.difference = on && this.runs.length > 1;
    this.refresh();
  }

  pressed(event) {
    const {tagName, type} = event.target;
    const typing = tagName === 'SELECT' || (tagName === 'INPUT' && !['checkbox', 'radio', 'range'].includes(type));
    if (event.altKey || typing) return;
    if ((event.ctrlKey || event.metaKey) && event.key === 'z') { event.preventDefault(); this.undo(); return; }
    if (event.ctrlKey || event.metaKey) return;
    const panel = this.panels.find(({root}) => root.contains(event.target)) ?? this.panels[0];
    const far = event.shiftKey ? 10 : 1;
    const actions = {
      ArrowLeft: () => this.seek(this.state.time - far * this.step),
      ArrowRight: () => this.seek(this.state.time + far * this.step),
      Home: () => this.seek(this.ends()[0]),
      End: () => this.seek(this.ends()[1]),
      '+': () => this.zoom(1.6), '-': () => this.zoom(1 / 1.6), 0: () => this.showWhole(),
      i: () => panel?.zoomUp(1.25), o: () => panel?.zoomUp(0.8), k: () => panel?.goToPeak(),
      d: () => this.setDifference(!this.state.difference), p: () => this.setPin(), u: () => this.undo(),
    };
    if (type === 'radio') { delete actions.ArrowLeft; delete actions.ArrowRight; }
    if (tagName !== 'BUTTON' && type !== 'checkbox' && type !== 'radio' && this.road) actions[' '] = () => this.road.toggle();
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  removePanel(spec) {
    this.state.panels = this.state.panels.filter((one) => one !== spec);
    this.refresh();
  }

  movePanel(spec, by) {
    const panels = this.state.panels.filter((one) => one !== spec);
    panels.splice(this.state.panels.indexOf(spec) + by, 0, spec);
    this.state.panels = panels;
    this.refresh();
  }

  enlarge(spec) {
    const {tall} = this.state;
    this.state.tall = tall.includes(spec) ? tall.filter((one) => one !== spec) : [...tall, spec];
    this.refresh();
  }

  // Name of a file of what is drawn.
  fileName(suffix) {
    const words = [this.data.file, this.drawnInstead].filter(Boolean).join(' ').replace(/[^\p{L}\p{N}.,=+-]+/gu, '_');
    return `${words.slice(0, LONGEST_NAME)}.${suffix}`;
  }

  // The signals of all panels within the span, or their differences from the baseline, in SI units; a column per run
  // and signal.
  csv() {
    const [from, to] = this.span();
    const {difference} = this.state;
    const signals = this.panels.flatMap((panel) => (difference ? panel.signals.slice(0, 1) : panel.signals));
    const names = [...new Set(signals)].filter((name) => !difference || this.baseline.has(name));
    const lines = [];
    lines.push(['run', 'time [s]', ...names.map((name) => `${name} [${this.meaning(name).si || '1'}]`)].map(quoted).join(','));
    for (const run of this.drawnRuns()) {
      const columns = names.map((name) => run.has(name) && (difference ? this.fromBaseline(run, name) : run.column(name)));
      const grains = names.map((name) => run.has(name) && this.grain(run, name));
      const cell = (value, grain) => (Number.isFinite(value) ? Number(knownDigits(value, 9, grain / 10)) : '');
      const xs = this.horizontal(run);
      for (let i = 0; i < run.rows; i++) {
        if (xs[i] < from || xs[i] > to) continue;
        const cells = columns.map((column, k) => (column ? cell(column[i], grains[k]) : ''));
        lines.push([quoted(this.drawnLabel(run)), run.shifted[i], ...cells].join(','));
      }
    }
    return lines.join('\n') + '\n';
  }
}

// A cell of a CSV file.
function quoted(text) { return `"${String(text ?? '').replaceAll('"', '""')}"`; }

function saveFile(blob, name) {
  const link = made('a', '', {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

async function copyAddress(button) {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(location.href);
    button.textContent = 'Copied';
  } catch {
    button.textContent = 'See the address bar';
  }
  setTimeout(() => { button.textContent = before; }, 1500);
}

let bytesOf = (block) => inflate(block.textContent); // a served page has its own

async function startViewer(root) {
  root.classList.add('yv-started');
  const data = JSON.parse(await unpacked(root.querySelector('script[type="application/json"]')));
  return fillViewer(root, data, [...root.querySelectorAll('script[type="text/plain"]')].map((block) => bytesOf(block)));
}

// Return the viewer; null if another has taken its place before the runs were there.
async function fillViewer(root, data, blocks) {
  const bytes = await Promise.all(blocks);
  if (!root.isConnected) return null;
  root.viewer = new Viewer(root, data, data.runs.map((run, k) => new Run(run, bytes[k], k)));
  return root.viewer;
}

async function startAll() {
  for (const root of document.querySelectorAll('.yv:not(.yv-started)')) await startViewer(root);
}

ready(startAll);
