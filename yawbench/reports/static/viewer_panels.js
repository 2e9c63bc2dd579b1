// One panel: signals of all shown runs over a common horizontal axis. uPlot draws axes and zooms; the lines are
// thinned here to what the pixels can show, smallest and largest value of each column of pixels.

const PANEL_HEIGHT = 94;
const ROW_HEIGHT = 18; // of the table beside a panel, which is as high while that is no portrait
const PORTRAIT_HEIGHT = 260; // over another signal: a phase portrait needs both directions
const CURSOR_DIGITS = 4;

// `turn`: an angle's whole turn; the line breaks where it leaves its range at one end and comes back at the other.
function linePath(u, xs, ys, factor, turn) {
  const path = new Path2D();
  const {left, width, top, height} = u.bbox;
  const {x: across, y: up} = u.scales;
  const toX = width / (across.max - across.min);
  const toY = (factor * height) / (up.max - up.min);
  const bottom = top + height + (up.min * height) / (up.max - up.min);
  let [column, low, high, last, pen, before] = [null, 0, 0, 0, false, NaN];
  const flush = () => {
    if (column === null || low === high) return;
    path.lineTo(column, low);
    path.lineTo(column, high);
    path.lineTo(column, last);
  };
  for (let i = 0; i < xs.length; i++) {
    const value = ys[i];
    if (!(Number.isFinite(value) && Number.isFinite(xs[i]))) {
      flush();
      [column, pen] = [null, false];
      continue;
    }
    if (turn && Math.abs(value - before) > turn / 2) {
      flush();
      [column, pen] = [null, false];
    }
    before = value;
    const x = left + (xs[i] - across.min) * toX;
    const outside = (x < left - width && i + 1 < xs.length && xs[i + 1] < across.min)
      || (x > left + 2 * width && i > 0 && xs[i - 1] > across.max);
    if (outside) {
      flush();
      [column, pen] = [null, false];
      continue;
    }
    const y = bottom - value * toY;
    const at = Math.round(x * 2) / 2;
    if (at === column) {
      if (y < low) low = y;
      if (y > high) high = y;
    } else {
      flush();
      if (pen) path.lineTo(x, y); else path.moveTo(x, y);
      [column, low, high, pen] = [at, y, y, true];
    }
    last = y;
  }
  flush();
  return path;
}

// A round number for a unit's axis: digits as few as tell ticks apart.
function ticks(u, splits) {
  const step = splits.length > 1 ? Math.abs(splits[1] - splits[0]) : 1;
  let decimals = 0;
  while (decimals < 8 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6) decimals++;
  return splits.map((value) => (value == null ? '' : decimal(value, decimals)));
}

class Panel {
  constructor(viewer, spec) {
    this.viewer = viewer;
    this.spec = spec;
    this.signals = spec.split(',').map((name) => name.trim());
    this.build();
  }

  // What is drawn: a line per run and signal; further signals of a panel are references, wide and pale.
  lines() {
    const {viewer} = this;
    const found = [];
    for (const [k, name] of this.signals.entries()) {
      for (const run of viewer.runs) {
        if (!run.has(name) || (k > 0 && run !== viewer.lead()) || (run.band && viewer.state.x === 'time')) continue;
        const difference = viewer.state.difference && run !== viewer.baseline;
        if (viewer.state.difference && (k > 0 || !viewer.baseline.has(name) || run === viewer.baseline)) continue;
        const values = difference ? viewer.fromBaseline(run, name) : run.column(name);
        const grain = viewer.grain(run, name);
        found.push({run, name, values, grain, xs: viewer.horizontal(run), reference: k > 0});
      }
    }
    const rank = ({run, reference}) => (run.band ? 0 : reference ? 1 : 2);
    return found.sort((one, other) => rank(one) - rank(other));
  }

  get meaning() { return this.viewer.meaning(this.signals[0]); }

  build() {
    const {viewer} = this;
    const root = made('div', '', {className: 'yv-panel', role: 'group'});
    const {label, unit} = this.meaning;
    root.setAttribute('aria-label', label);
    root.innerHTML = '<header><h4></h4><small></small><output></output><button type="button">✕</button></header>'
      + '<div class="yv-chart"></div><table><caption class="yv-hidden"></caption>'
      + '<thead class="yv-hidden"><tr><th scope="col">run</th><th scope="col">at the cursor</th>'
      + '<th scope="col">smallest</th><th scope="col">largest</th></tr></thead><tbody></tbody></table><p class="yv-hidden"></p>';
    const minus = viewer.state.difference ? `, minus ${viewer.baseline.label}` : '';
    root.querySelector('h4').textContent = (unit ? `${label} in ${unit}` : label) + minus;
    root.querySelector('h4').setAttribute('aria-level', viewer.level);
    const names = root.querySelector('small');
    names.textContent = names.title = this.signals.join(', ');
    root.querySelector('caption').textContent = `Values of ${label}`;
    const remove = root.querySelector('button');
    remove.setAttribute('aria-label', `Remove ${label}`);
    remove.addEventListener('click', () => viewer.removePanel(this.spec));
    Object.assign(this, {
      root, chart: root.querySelector('.yv-chart'), table: root.querySelector('table'),
      body: root.querySelector('tbody'), sentence: root.querySelector('p'), remark: root.querySelector('output'),
    });
  }

  draw(last, wide) {
    const {viewer} = this;
    if (this.plot) this.plot.destroy();
    this.drawn = this.lines();
    const shown = this.drawn.filter(({run}) => viewer.shows(run));
    const theme = viewer.theme;
    const {factor} = this.meaning;
    const beside = Math.min(Math.max(PANEL_HEIGHT, ROW_HEIGHT * shown.length), PORTRAIT_HEIGHT);
    const axis = {stroke: theme.quiet, font: '12px system-ui, sans-serif', grid: {stroke: theme.line, width: 1}, ticks: {show: false}};
    const options = {
      width: Math.max(wide, 160),
      height: (viewer.state.x in viewer.data.signals ? PORTRAIT_HEIGHT : beside) + (last ? 34 : 0),
      padding: [6, 10, last ? 0 : 4, 0],
      legend: {show: false},
      cursor: {x: false, y: false, points: {show: false}, drag: {x: true, y: false, setScale: false}},
      scales: {
        x: {time: false, range: () => viewer.span()},
        y: {range: () => this.heights(shown, factor)},
      },
      axes: [
        {...axis, size: last ? 22 : 6, values: last ? ticks : () => [], label: last ? viewer.axisLabel : undefined, labelSize: 16, labelGap: 0, labelFont: '12px system-ui, sans-serif'},
        {...axis, size: 56, values: ticks, space: 17},
      ],
      series: [{}, ...shown.map(({run, values, xs, reference}) => ({
        stroke: reference ? theme.pale : viewer.colour(run),
        width: reference ? 5 : 1.7,
        dash: reference ? [] : viewer.dash(run).map((part) => 1.7 * part),
        fill: run.band ? theme.band : undefined,
        paths: (u) => {
          const path = linePath(u, xs, values, factor, this.meaning.si === 'rad' ? 2 * Math.PI : 0);
          return {stroke: path, fill: run.band ? path : null, clip: null, flags: 1};
        },
        points: {show: false},
      }))],
      hooks: {
        drawClear: [(u) => this.behind(u)],
        draw: [(u) => { this.above(u, factor); this.moveCursor(); }],
        setSelect: [(u) => this.selected(u)],
        ready: [(u) => this.listen(u)],
      },
    };
    const ends = viewer.span();
    this.chart.replaceChildren();
    this.plot = new viewer.Plot(options, [ends, ...shown.map(() => [0, 0])], this.chart);
    this.plot.root.setAttribute('aria-hidden', 'true');
    this.pointer = made('div', '', {className: 'yv-pointer'});
    this.plot.over.append(this.pointer);
    this.dots = shown.map(({run, reference}) => {
      const dot = made('i', '', {className: 'yv-dot'});
      dot.style.background = reference ? theme.pale : viewer.colour(run);
      this.plot.over.append(dot);
      return dot;
    });
    this.shown = shown;
    this.tabulate(factor);
  }

  // Draw the span anew; what the panel has beside it stays.
  zoom() {
    const [min, max] = this.viewer.span();
    this.plot?.setScale('x', {min, max});
  }

  // Vertical limits: all values within the horizontal span, and some room.
  heights(shown, factor) {
    const [from, to] = this.viewer.span();
    let range = [Infinity, -Infinity];
    for (const {xs, values} of shown) {
      for (let i = 0; i < xs.length; i++) {
        if (xs[i] < from || xs[i] > to || !Number.isFinite(values[i])) continue;
        const value = values[i] * factor;
        if (value < range[0]) range[0] = value;
        if (value > range[1]) range[1] = value;
      }
    }
    range = extremes(this.limits().map((bound) => bound * factor), range);
    if (!(range[0] <= range[1])) return [-1, 1];
    const room = 0.07 * (range[1] - range[0]) || Math.abs(range[0]) * 0.1 || 1;
    return [range[0] - room, range[1] + room];
  }

  // The limits of the panel's signals, of shown runs.
  limits() {
    const {data, state} = this.viewer;
    const own = state.difference ? [] : data.limits.filter(([name, , , run]) => this.signals.includes(name) && this.viewer.tells(run));
    return own.map(([, bound]) => bound);
  }

  behind(u) {
    const {ctx, bbox} = u;
    const {viewer} = this;
    if (viewer.state.x !== 'time') return;
    ctx.save();
    ctx.fillStyle = viewer.theme.faulty;
    for (const [begin, end] of viewer.faults()) {
      const [x0, x1] = [begin, end].map((t) => Math.min(Math.max(u.valToPos(t, 'x', true), bbox.left), bbox.left + bbox.width));
      ctx.fillRect(x0, bbox.top, x1 - x0, bbox.height);
    }
    ctx.restore();
  }

  above(u, factor) {
    const {ctx, bbox} = u;
    const {viewer} = this;
    ctx.save();
    const ratio = ctx.canvas.width / u.width;
    ctx.lineWidth = ratio;
    ctx.strokeStyle = viewer.theme.mark;
    ctx.setLineDash([4 * ratio, 3 * ratio]);
    ctx.beginPath();
    const tolerance = this.tolerance();
    for (const bound of [...this.limits(), ...(tolerance > 0 ? [tolerance, -tolerance] : [])]) {
      const y = u.valToPos(bound * factor, 'y', true);
      if (y < bbox.top || y > bbox.top + bbox.height) continue;
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
    }
    if (viewer.state.x === 'time') {
      for (const [time, , run] of viewer.data.marks) {
        if (!viewer.tells(run)) continue;
        const x = u.valToPos(time, 'x', true);
        if (x < bbox.left || x > bbox.left + bbox.width) continue;
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
      }
    }
    ctx.stroke();
    ctx.restore();
  }

  // The difference that is tolerated, in the signal's unit: a share of the baseline's largest value.
  tolerance() {
    const {viewer} = this;
    const name = this.signals[0];
    if (!viewer.state.difference || !(viewer.state.tolerance > 0) || !viewer.baseline.has(name)) return 0;
    const [low, high] = extremes(viewer.baseline.column(name));
    return (viewer.state.tolerance / 100) * Math.max(high, -low, 0);
  }

  listen(u) {
    const {viewer} = this;
    u.over.addEventListener('pointermove', (event) => viewer.pointAt(this, event.offsetX, event));
    u.over.addEventListener('dblclick', () => viewer.zoomTo(null));
    u.over.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      const turned = event.deltaY || event.deltaX;
      viewer.zoom(turned < 0 ? 1.25 : 0.8, u.posToVal(event.offsetX, 'x'));
    }, {passive: false});
  }

  selected(u) {
    const {left, width} = u.select;
    if (width < 4) return;
    const span = [u.posToVal(left, 'x'), u.posToVal(left + width, 'x')];
    u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
    this.viewer.zoomTo(span);
  }

  moveCursor() {
    if (!this.plot || !this.cells) return;
    const {viewer} = this;
    const time = viewer.state.time;
    const {factor} = this.meaning;
    const ratio = this.plot.ctx.canvas.width / this.plot.width;
    const [wide, high] = [this.plot.bbox.width / ratio, this.plot.bbox.height / ratio];
    this.shown.forEach((line, k) => {
      const [row, part] = place(line.run.shifted, time);
      const at = part > 0.5 ? row + 1 : row;
      const inside = !line.run.band && time >= line.run.shifted[0] - 1e-9 && time <= line.run.shifted[line.run.rows - 1] + 1e-9;
      const value = inside ? line.values[at] * factor : NaN;
      const x = this.plot.valToPos(line.xs[at], 'x');
      const y = this.plot.valToPos(value, 'y');
      const seen = Number.isFinite(value) && x >= 0 && x <= wide && y >= -2 && y <= high + 2;
      this.dots[k].style.display = seen ? '' : 'none';
      if (seen) this.dots[k].style.transform = `translate(${x}px, ${y}px)`;
      this.cells[k].textContent = Number.isFinite(value) ? this.text(value, line.grain * Math.abs(factor)) : '–';
    });
    const lead = viewer.lead();
    const [row, part] = place(lead.shifted, time);
    const x = this.plot.valToPos(viewer.horizontal(lead)[part > 0.5 ? row + 1 : row], 'x');
    this.pointer.style.display = x >= 0 && x <= wide ? '' : 'none';
    this.pointer.style.transform = `translateX(${x}px)`;
  }

  text(value, grain) { return knownDigits(value, CURSOR_DIGITS, grain).replace('-', '−'); }

  tabulate(factor) {
    const {viewer} = this;
    this.body.replaceChildren();
    this.cells = [];
    const words = [];
    for (const {run, name, values, grain, reference} of this.shown) {
      const row = this.body.insertRow();
      const title = reference ? `reference, ${name} of ${run.label}` : run.label;
      const head = made('th', '', {scope: 'row', title, innerHTML: viewer.swatch(run, reference)});
      head.append(made('span', title, {className: 'yv-hidden'}));
      row.append(head);
      this.cells.push(row.insertCell());
      const [low, high] = extremes(values);
      const texts = low <= high ? [low, high].map((one) => knownDigits(one * factor, CURSOR_DIGITS, grain * Math.abs(factor))) : ['no number', 'no number'];
      row.append(...texts.map((one) => made('td', one, {className: 'yv-hidden'})));
      words.push(`${title}: ${texts.join(' to ')}`);
    }
    this.sentence.textContent = words.length ? `${words.join('; ')} ${this.meaning.unit}.` : 'No shown run has recorded it.';
    this.tellTolerance();
  }

  tellTolerance() {
    const tolerance = this.tolerance();
    this.remark.textContent = '';
    if (!(tolerance > 0)) return;
    const found = this.shown.map(({run, values}) => {
      const first = values.findIndex((value) => Math.abs(value) > tolerance);
      return first < 0 ? null : [run.shifted[first], run.label];
    }).filter(Boolean).sort((one, other) => one[0] - other[0]);
    this.remark.textContent = found.length
      ? `beyond ${this.viewer.state.tolerance} % from ${digitsOf(found[0][0], 4)} s (${found[0][1]})`
      : `within ${this.viewer.state.tolerance} %`;
  }
}
