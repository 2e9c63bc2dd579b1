// Charts over a common horizontal axis. uPlot draws axes; the lines are thinned here to what the pixels can show,
// smallest and largest value of each column of pixels.

const PANEL_HEIGHT = 94;
const ROW_HEIGHT = 18; // of the table beside a panel, which is as high while that is no portrait
const PORTRAIT_HEIGHT = 260; // over another signal: a phase portrait needs both directions
const ENLARGED = 2.6; // times as high; chosen: about half a screen
const AXIS_WIDTH = 56; // left of all charts, so that they stand below each other
const FONT = '12px system-ui, sans-serif';
const CURSOR_DIGITS = 4;
const LEAST_SHARE = 1e-6; // of a panel's largest value: what is less reads as zero; chosen: rounding of the solvers is less
const CLICK = 4; // pixels within which a pointer has not been dragged
const STRIP = 14; // pixels across within which a drag chooses one direction alone

// Trace a line into a path, of a canvas or of any object with `moveTo` and `lineTo`, within a frame: the box of a chart
// in pixels, and the ranges of both axes in shown units.
// `turn`: an angle's whole turn; the line breaks where it leaves its range at one end and comes back at the other.
function traceLine(path, {left, top, width, height, across, up}, xs, ys, factor, turn) {
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

class Chart {
  // Draw the span anew; what the chart has beside it stays.
  zoom() {
    const [min, max] = this.viewer.span();
    this.plot?.setScale('x', {min, max});
  }
}

// The axis below all panels, and the pin and the cursor on it: it stays in sight.
class Axis extends Chart {
  constructor(viewer) { Object.assign(super(), {viewer, chart: viewer.find('axis')}); }

  draw(wide) {
    const {viewer} = this;
    this.plot?.destroy();
    const axis = {stroke: viewer.theme.quiet, font: FONT, grid: {show: false}, ticks: {show: false}};
    this.plot = new viewer.Plot({
      width: Math.max(wide, 160), height: 36, padding: [0, 10, 0, 0], legend: {show: false}, cursor: {show: false},
      scales: {x: {time: false, range: () => viewer.span()}, y: {range: () => [0, 1]}},
      axes: [{...axis, size: 18, values: ticks, label: viewer.axisLabel, labelSize: 16, labelGap: 0, labelFont: FONT}, {...axis, size: AXIS_WIDTH, values: () => []}],
      series: [{}, {show: false}],
    }, [viewer.span(), [0, 0]], this.chart);
    this.plot.root.setAttribute('aria-hidden', 'true');
  }
}

class Panel extends Chart {
  constructor(viewer, spec) {
    Object.assign(super(), {viewer, spec, signals: spec.split(',').map((name) => name.trim())});
    this.build();
  }

  // What is drawn: a line per run and signal; further signals of a panel are the runs' references, wide and pale, those
  // that are the same drawn once.
  lines() {
    const {viewer} = this;
    const {difference, x} = viewer.state;
    const found = [];
    for (const [k, name] of this.signals.entries()) {
      for (const run of viewer.runs) {
        if (!run.has(name) || (run.band && x === 'time') || (k > 0 && (viewer.portrait || !viewer.shows(run)))) continue;
        if (difference && (k > 0 || !viewer.baseline.has(name) || run === viewer.baseline)) continue;
        const values = difference ? viewer.fromBaseline(run, name) : run.column(name);
        const line = {run, name, values, grain: viewer.grain(run, name), xs: viewer.horizontal(run), reference: k > 0};
        if (k === 0 || !found.some((other) => other.name === name && alike(other, line))) found.push(line);
      }
    }
    const own = found.filter((line) => line.reference).length > 1;
    for (const line of found) line.colour = line.reference ? (own ? viewer.faint(line.run) : viewer.theme.pale) : viewer.colour(line.run);
    const rank = ({run, reference}) => (run.band ? 0 : reference ? 1 : 2);
    return found.sort((one, other) => rank(one) - rank(other));
  }

  get meaning() { return this.viewer.meaning(this.signals[0]); }

  get title() {
    return inUnit(this.meaning) + (this.viewer.state.difference ? `, ${this.viewer.drawnInstead}` : '');
  }

  // The angle after which a line breaks.
  get turn() { return this.meaning.si === 'rad' ? 2 * Math.PI : 0; }

  build() {
    const {viewer} = this;
    const root = made('div', '', {className: 'yv-panel', role: 'group'});
    const {label} = this.meaning;
    root.setAttribute('aria-label', label);
    root.innerHTML = '<header><h4></h4><small></small><output></output><span class="yv-tools"></span></header>'
      + '<div class="yv-chart"></div><table><caption class="yv-hidden"></caption>'
      + '<thead class="yv-hidden"><tr><th scope="col">run</th><th scope="col">at the cursor</th>'
      + `${viewer.state.pin === null ? '' : '<th scope="col">since the pin</th>'}</tr></thead><tbody>`
      + '</tbody></table><p class="yv-hidden"></p>';
    root.querySelector('h4').textContent = this.title;
    root.querySelector('h4').setAttribute('aria-level', viewer.level);
    const names = root.querySelector('small');
    names.textContent = names.title = this.signals.join(', ');
    root.querySelector('caption').textContent = `Values of ${label}`;
    const tool = (sign, says, act) => {
      const button = made('button', sign, {type: 'button', title: says});
      button.setAttribute('aria-label', `${says}: ${label}`);
      button.addEventListener('click', act);
      return button;
    };
    const place = viewer.state.panels.indexOf(this.spec);
    root.querySelector('.yv-tools').append(
      tool('peak', 'Go to the peak, then to those of the other runs', () => this.goToPeak()),
      ...(place > 0 ? [tool('↑', 'Move up', () => viewer.movePanel(this.spec, -1))] : []),
      ...(place < viewer.state.panels.length - 1 ? [tool('↓', 'Move down', () => viewer.movePanel(this.spec, 1))] : []),
      tool('⤢', viewer.state.tall.includes(this.spec) ? 'Make it as high as the others' : 'Enlarge', () => viewer.enlarge(this.spec)),
      tool('✕', 'Remove', () => viewer.removePanel(this.spec)),
    );
    const lit = viewer.state.lit;
    this.lit = lit && this.signals.includes(lit[0]) ? lit : null;
    root.classList.toggle('yv-lit', Boolean(this.lit));
    Object.assign(this, {
      root, chart: root.querySelector('.yv-chart'), table: root.querySelector('table'),
      body: root.querySelector('tbody'), sentence: root.querySelector('p'), remark: root.querySelector('output'),
    });
  }

  draw(wide) {
    const {viewer} = this;
    if (this.plot) this.plot.destroy();
    this.drawn = this.lines();
    const shown = this.drawn.filter(({run}) => viewer.shows(run));
    const theme = viewer.theme;
    const {factor} = this.meaning;
    this.largest = Math.max(...shown.map(({values}) => { const [low, high] = extremes(values); return Math.max(high, -low, 0); }), 0);
    const beside = Math.min(Math.max(PANEL_HEIGHT, ROW_HEIGHT * shown.length), PORTRAIT_HEIGHT);
    const usual = viewer.portrait ? PORTRAIT_HEIGHT : beside;
    const axis = {stroke: theme.quiet, font: FONT, grid: {stroke: theme.line, width: 1}, ticks: {show: false}};
    const options = {
      width: Math.max(wide, 160),
      height: viewer.state.tall.includes(this.spec) ? Math.round(ENLARGED * Math.min(usual, 180)) : usual,
      padding: [6, 10, 4, 0],
      legend: {show: false},
      cursor: {show: false},
      scales: {
        x: {time: false, range: () => viewer.span()},
        y: {range: () => this.heights(shown, factor)},
      },
      axes: [{...axis, size: 6, values: () => []}, {...axis, size: AXIS_WIDTH, values: ticks, space: 17}],
      series: [{}, ...shown.map(({run, values, xs, reference, colour}) => ({
        stroke: colour,
        width: reference ? 5 : 1.7,
        dash: reference ? [] : viewer.dash(run).map((part) => 1.7 * part),
        fill: run.band ? theme.band : undefined,
        paths: (u) => {
          const path = traceLine(new Path2D(), this.frame, xs, values, factor, this.turn);
          return {stroke: path, fill: run.band ? path : null, clip: null, flags: 1};
        },
        points: {show: false},
      }))],
      hooks: {
        drawClear: [(u) => { this.plot = u; this.behind(u.ctx, this.frame); }],
        draw: [(u) => { this.above(u.ctx, this.frame, u.ctx.canvas.width / u.width); this.moveCursor(); }],
      },
    };
    this.chart.replaceChildren();
    this.plot = new viewer.Plot(options, [viewer.span(), ...shown.map(() => [0, 0])], this.chart);
    this.plot.root.setAttribute('aria-hidden', 'true');
    [this.pointer, this.pinned, this.box] = ['pointer', 'pin', 'box'].map((name) => made('div', '', {className: `yv-${name}`}));
    this.plot.over.append(this.pointer, ...(viewer.state.pin === null ? [] : [this.pinned]));
    this.dots = shown.map(({colour}) => {
      const dot = made('i', '', {className: 'yv-dot'});
      dot.style.background = colour;
      this.plot.over.append(dot);
      return dot;
    });
    this.shown = shown;
    this.tabulate(factor);
    this.listen(this.plot.over);
  }

  get frame() {
    const {bbox: {left, top, width, height}, scales: {x, y}} = this.plot;
    return {left, top, width, height, across: x, up: y};
  }

  // Vertical limits: those of the reader, else all values within the horizontal span, and some room.
  heights(shown, factor) {
    const own = this.viewer.state.heights[this.spec];
    if (own) return own;
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
    range = extremes(this.limits().map(([bound]) => bound * factor), range);
    for (const [, xs, ys] of this.viewer.curves(this.signals[0])) range = extremes(ys.filter((_, i) => xs[i] >= from && xs[i] <= to).map((y) => y * factor), range);
    if (!(range[0] <= range[1])) return [-1, 1];
    const room = 0.07 * (range[1] - range[0]) || Math.abs(range[0]) * 0.1 || 1;
    return [range[0] - room, range[1] + (this.marks().some(({text: says}) => says) ? 3 : 1) * room]; // above: their words
  }

  // The limits of the panel's signals that shown runs have, in SI, each with its text; last that of a claim.
  limits() {
    const {data, state} = this.viewer;
    if (state.difference) return [];
    const own = data.limits.filter(([name, , , run]) => this.signals.includes(name) && this.viewer.tells(run));
    const lit = this.lit && this.lit[1] !== null ? [[this.lit[1], '', true], [-this.lit[1], '', true]] : [];
    return [...own.map(([, bound, text]) => [bound, text]), ...lit];
  }

  // Instants to mark: those of tests, of all panels, and the events that this panel's signals show.
  marks() {
    const {viewer} = this;
    if (viewer.state.x !== 'time') return [];
    const first = viewer.state.panels[0] === this.spec;
    const tests = viewer.data.marks.filter(([, , run]) => viewer.tells(run))
      .map(([time, text, run]) => ({time: time + viewer.offset(run), text: first ? text : '', colour: viewer.theme.mark}));
    const events = viewer.state.difference ? [] : viewer.runs.filter((run) => viewer.shows(run)).flatMap((run) => run.events
      .filter(({signal}) => this.signals.includes(signal))
      .map(({time, label}) => ({time: time + viewer.offset(run.number), text: label, colour: viewer.colour(run), short: true})));
    return [...tests, ...events].sort((one, other) => one.time - other.time);
  }

  behind(c, {left, top, width, height, across}) {
    const {viewer} = this;
    if (viewer.state.x !== 'time') return;
    c.save();
    c.fillStyle = viewer.theme.faulty;
    for (const [begin, end] of viewer.faults()) {
      const [x0, x1] = [begin, end].map((t) => left + width * Math.min(Math.max((t - across.min) / (across.max - across.min), 0), 1));
      c.fillRect(x0, top, x1 - x0, height);
    }
    c.restore();
  }

  // Limits, tolerance, marks with their words, and limit curves of a plane, on a canvas or a picture.
  above(c, frame, ratio) {
    const {left, top, width, height, across, up} = frame;
    const {viewer} = this;
    const {factor} = this.meaning;
    const toX = (x) => left + ((x - across.min) / (across.max - across.min)) * width;
    const toY = (y) => top + height - ((y - up.min) / (up.max - up.min)) * height;
    const line = (points, colour, wide, dash) => { polyline(c, points.map(([x]) => x), points.map(([, y]) => y)); stroke(c, colour, wide, ratio, dash); };
    c.save();
    const words = {size: 10.5 * ratio, colour: viewer.theme.quiet, ground: viewer.theme.ground};
    const tolerance = this.tolerance();
    for (const [bound, says, lit] of [...this.limits(), ...(tolerance > 0 ? [[tolerance, ''], [-tolerance, '']] : [])]) {
      const y = toY(bound * factor);
      if (y < top || y > top + height) continue;
      line([[left, y], [left + width, y]], viewer.theme.mark, lit ? 2 : 1, lit ? [] : [4, 3]);
      if (says) text(c, says, left + width - 4 * ratio, y + (y < top + 14 * ratio ? 8 : -7) * ratio, {...words, align: 'right'});
    }
    c.save();
    c.beginPath();
    c.rect(left, top, width, height);
    c.clip();
    for (const [says, xs, ys] of viewer.curves(this.signals[0])) {
      const [px, py] = [xs.map(toX), ys.map((y) => toY(y * factor))];
      polyline(c, px, py);
      stroke(c, viewer.theme.mark, 1.3, ratio, [4, 3]);
      const at = px.findIndex((x, i) => x > left + 8 * ratio && x < left + 0.75 * width && py[i] > top + 14 * ratio && py[i] < top + height - 14 * ratio);
      if (says && at >= 0) text(c, says, px[at] + 5 * ratio, py[at] - 8 * ratio, words);
    }
    c.restore();
    const rows = Array.from({length: Math.max(1, Math.floor(height / ratio / 32))}, () => -Infinity); // ends of the words in each
    c.font = `${words.size}px system-ui, sans-serif`;
    for (const {time, text: says, colour, short} of this.marks()) {
      const x = toX(time);
      if (x < left || x > left + width) continue;
      line([[x, top], [x, top + (short ? 0.32 : 1) * height]], colour, short ? 1.6 : 1, short ? [] : [4, 3]);
      const wide = c.measureText(says).width;
      const row = says ? rows.findIndex((end) => x > end) : -1;
      const before = x + wide > left + width;
      if (row < 0 || (before && x - wide < Math.max(rows[row], left))) continue;
      rows[row] = x + (before ? 0 : wide) + 8 * ratio;
      text(c, says, x + (before ? -3 : 3) * ratio, top + (6 + 12 * row) * ratio, {...words, align: before ? 'right' : 'left'});
    }
    c.restore();
  }

  // The difference that is tolerated, in the signal's unit: a share of the baseline's largest value.
  tolerance() {
    const {viewer} = this;
    const name = this.signals[0];
    if (!viewer.state.difference || !(viewer.state.tolerance > 0) || !viewer.baseline.has(name)) return 0;
    const [low, high] = extremes(viewer.baseline.column(name));
    return (viewer.state.tolerance / 100) * Math.max(high, -low, 0);
  }

  // ---- pointers: a mouse hovers to move the cursor, drags to zoom, drags with Shift to pan; one finger moves the
  // cursor, two pinch ----

  listen(over) {
    const {viewer} = this;
    const down = new Map(); // pointer -> where it is
    let begun = null;
    const at = (event) => [event.offsetX, event.offsetY];
    const begin = (how) => {
      const [from, to] = viewer.span();
      const {min, max} = this.plot.scales.y;
      const points = [...down.values()];
      begun = {how, points, span: [from, to], heights: [min, max], moved: false};
    };
    over.addEventListener('pointerdown', (event) => {
      if (event.button > 1) return;
      event.preventDefault();
      viewer.find('panels').focus({preventScroll: true});
      over.setPointerCapture(event.pointerId);
      down.set(event.pointerId, at(event));
      if (down.size > 1) begin('pinch');
      else begin(event.pointerType === 'touch' ? 'point' : event.shiftKey || event.button === 1 ? 'pan' : 'box');
    });
    over.addEventListener('pointermove', (event) => {
      if (!down.has(event.pointerId)) {
        if (event.pointerType !== 'touch') viewer.pointAt(this, ...at(event));
        return;
      }
      down.set(event.pointerId, at(event));
      if (begun) this.dragged(begun, [...down.values()]);
    });
    const end = (event) => {
      if (!down.has(event.pointerId)) return;
      const now = at(event);
      down.delete(event.pointerId);
      this.box.remove();
      if (begun?.how === 'box' && begun.moved) this.boxed(begun.points[0], now);
      else if (begun && !begun.moved && begun.how !== 'pinch') viewer.pointAt(this, ...now);
      begun = null;
    };
    over.addEventListener('pointerup', end);
    over.addEventListener('pointercancel', (event) => { down.delete(event.pointerId); begun = null; this.box.remove(); });
    over.addEventListener('dblclick', () => viewer.showWhole());
    over.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !event.shiftKey && !event.altKey) return;
      event.preventDefault();
      const factor = (event.deltaY || event.deltaX) < 0 ? 1.25 : 0.8;
      if (event.altKey) this.zoomUp(factor, this.plot.posToVal(event.offsetY, 'y'));
      else viewer.zoom(factor, this.plot.posToVal(event.offsetX, 'x'));
    }, {passive: false});
  }

  dragged(begun, now) {
    const {viewer} = this;
    const [[x0, y0]] = begun.points;
    const [[x, y]] = now;
    begun.moved = begun.moved || Math.hypot(x - x0, y - y0) > CLICK;
    if (!begun.moved) return;
    const [from, to] = begun.span;
    const wide = this.plot.over.clientWidth;
    if (begun.how === 'point') viewer.pointAt(this, x, y);
    else if (begun.how === 'pan') {
      viewer.panTo(from - ((x - x0) * (to - from)) / wide, to - from);
      if (viewer.state.heights[this.spec]) {
        const [low, high] = begun.heights;
        const by = ((y - y0) * (high - low)) / this.plot.over.clientHeight;
        viewer.setHeights(this.spec, [low + by, high + by]);
      }
    } else if (begun.how === 'pinch' && now.length > 1) {
      const middle = (points) => (points[0][0] + points[1][0]) / 2;
      const apart = (points) => Math.max(Math.hypot(points[0][0] - points[1][0], points[0][1] - points[1][1]), 10);
      const held = from + (middle(begun.points) / wide) * (to - from);
      const span = ((to - from) * apart(begun.points)) / apart(now);
      viewer.panTo(held - (middle(now) / wide) * span, span);
    } else if (begun.how === 'box') {
      const [left, top, right, bottom] = this.corners(begun.points[0], [x, y]);
      this.plot.over.append(this.box);
      Object.assign(this.box.style, {left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px`});
    }
  }

  // The corners of a drag: along one axis alone, all of the chart along the other.
  corners([x0, y0], [x, y]) {
    const {clientWidth, clientHeight} = this.plot.over;
    const within = (value, most) => Math.min(Math.max(value, 0), most);
    const [xs, ys] = [[x0, x].map((one) => within(one, clientWidth)).sort((a, b) => a - b), [y0, y].map((one) => within(one, clientHeight)).sort((a, b) => a - b)];
    const [flat, narrow] = [ys[1] - ys[0] < STRIP, xs[1] - xs[0] < STRIP];
    return [narrow && !flat ? 0 : xs[0], flat ? 0 : ys[0], narrow && !flat ? clientWidth : xs[1], flat ? clientHeight : ys[1]];
  }

  boxed(from, to) {
    const [left, top, right, bottom] = this.corners(from, to);
    const {clientWidth, clientHeight} = this.plot.over;
    const value = (at, axis) => this.plot.posToVal(at, axis);
    const heights = [value(bottom, 'y'), value(top, 'y')];
    const span = [value(left, 'x'), value(right, 'x')];
    if (bottom - top < clientHeight) this.viewer.setHeights(this.spec, heights);
    if (right - left < clientWidth) this.viewer.zoomTo(span);
  }

  zoomUp(factor, around) {
    const {min, max} = this.plot.scales.y;
    const middle = around ?? (min + max) / 2;
    this.viewer.setHeights(this.spec, [middle - (middle - min) / factor, middle + (max - middle) / factor]);
  }

  // ---- the cursor ----

  // The largest value of each shown run within the span, largest first.
  peaks() {
    const [from, to] = this.viewer.span();
    const found = [];
    for (const {run, values, xs, grain, reference} of this.shown) {
      if (reference || run.band) continue;
      let [best, most] = [-1, -1];
      for (let i = 0; i < xs.length; i++) if (xs[i] >= from && xs[i] <= to && Math.abs(values[i]) > most) [best, most] = [i, Math.abs(values[i])];
      if (best >= 0) found.push({run, time: run.shifted[best], value: values[best], grain, growing: best === run.rows - 1 && run.rows > 1});
    }
    return found.sort((one, other) => Math.abs(other.value) - Math.abs(one.value));
  }

  goToPeak() {
    const found = this.peaks();
    if (!found.length) return;
    this.visited = this.visited === undefined ? 0 : (this.visited + 1) % found.length;
    const {run, time, value, grain, growing} = found[this.visited];
    const {factor, unit} = this.meaning;
    this.viewer.seek(time);
    this.remark.textContent = `peak of ${this.viewer.drawnLabel(run)}: ${this.text(value * factor, grain * Math.abs(factor))} ${unit} at ${time.toFixed(3)} s${growing ? ', still growing' : ''}`;
  }

  // Index of a run's row at a time; -1 before its begin and after its end.
  rowAt({run}, time) {
    if (run.band || time < run.shifted[0] - 1e-9 || time > run.shifted[run.rows - 1] + 1e-9) return -1;
    const [row, part] = place(run.shifted, time);
    return part > 0.5 ? row + 1 : row;
  }

  moveCursor() {
    if (!this.plot || !this.cells) return;
    const {viewer} = this;
    const {time, pin} = viewer.state;
    const {factor} = this.meaning;
    const {clientWidth: wide, clientHeight: high} = this.plot.over;
    this.shown.forEach((line, k) => {
      const [now, then] = [time, pin].map((t) => (t === null ? -1 : this.rowAt(line, t)));
      const [value, before] = [now, then].map((row) => (row < 0 ? NaN : line.values[row] * factor));
      const x = this.plot.valToPos(line.xs[Math.max(now, 0)], 'x');
      const y = this.plot.valToPos(value, 'y');
      const seen = Number.isFinite(value) && x >= 0 && x <= wide && y >= -2 && y <= high + 2;
      this.dots[k].style.display = seen ? '' : 'none';
      if (seen) this.dots[k].style.transform = `translate(${x}px, ${y}px)`;
      const [cell, since] = this.cells[k];
      cell.textContent = this.known(value, line);
      if (since) since.textContent = this.known(value - before, line, '+');
    });
    for (const [pointer, t] of [[this.pointer, time], [this.pinned, pin]]) {
      const row = t === null ? -1 : this.rowAt({run: viewer.lead()}, t);
      const x = viewer.state.x === 'time' ? this.plot.valToPos(t, 'x') : row < 0 ? NaN : this.plot.valToPos(viewer.horizontal(viewer.lead())[row], 'x');
      pointer.style.display = t !== null && x >= 0 && x <= wide ? '' : 'none';
      pointer.style.transform = `translateX(${x}px)`;
    }
  }

  // A value of a line with no digits finer than what is stored, nor than rounding.
  known(value, {grain}, plus = '') {
    if (!Number.isFinite(value)) return '–';
    const factor = Math.abs(this.meaning.factor);
    return (value > 0 ? plus : '') + this.text(value, Math.max(grain, LEAST_SHARE * this.largest) * factor);
  }

  text(value, grain) { return knownDigits(value, CURSOR_DIGITS, grain).replace('-', '−'); }

  tabulate(factor) {
    const {viewer} = this;
    this.body.replaceChildren();
    this.cells = [];
    const words = [];
    for (const {run, name, values, grain, reference, colour} of this.shown) {
      const row = this.body.insertRow();
      const title = reference ? `reference, ${name} of ${run.label}` : viewer.drawnLabel(run);
      const head = made('th', '', {scope: 'row', title, innerHTML: viewer.swatch(run, reference && colour)});
      head.append(made('span', title, {className: 'yv-hidden'}));
      row.append(head);
      this.cells.push([row.insertCell(), viewer.state.pin === null ? null : row.insertCell()]);
      const [low, high] = extremes(values);
      const texts = low <= high ? [low, high].map((one) => knownDigits(one * factor, CURSOR_DIGITS, grain * Math.abs(factor))) : ['no number', 'no number'];
      words.push(`${title}: ${texts.join(' to ')}`);
    }
    this.sentence.textContent = words.length ? `${words.join('; ')} ${this.meaning.unit}.` : 'No shown run has recorded it.';
    this.tellTolerance();
  }

  tellTolerance() {
    const tolerance = this.tolerance();
    this.remark.textContent = this.lit ? `judged: ${this.lit[2]}` : '';
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

// Whether two lines of one signal cannot be told apart.
function alike(one, other) {
  if (one.values.length !== other.values.length) return false;
  const grain = one.grain + other.grain;
  return one.values.every((value, i) => !(Math.abs(value - other.values[i]) > grain));
}
