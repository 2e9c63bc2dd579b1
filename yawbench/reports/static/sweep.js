// Runs over axes: a map with numbers, parallel coordinates with brushes, a limit to move. All in SVG; marks of one
// look share a path, so that thousands of runs are few elements.

const SHADES = 7; // of a value within its range
const MOST_NUMBERS = 450; // texts in the maps; chosen: a page has at most 2,000 elements
const MOST_CELLS = 900; // beyond this one map is shown at first
const LINES_HIGH = 330;
const MOST_NAMES = 16; // on an axis, so that none touches the next
const NEAR_LINE = 14; // pixels
const BESIDE_RUNS = 7; // runs opened with a point: as many as there are colours

const signed = (text) => text.replace('-', '−');

function opacityOf(shade) { return (0.07 + (0.5 * shade) / (SHADES - 1)).toFixed(2); }

// Where a value lies on an axis, from 0 to 1.
function partOf({range, log}, value) {
  const [low, here, high] = [range[0], value, range[1]].map((one) => (log ? Math.log(Math.abs(one)) : one));
  return (here - low) / (high - low);
}

class Sweep extends InAddress {
  constructor(root, data) {
    super();
    Object.assign(this, {root, data, key: root.id, find: (name) => root.querySelector('.ys-' + name)});
    this.count = data.status.length;
    this.rows = [...Array(this.count).keys()];
    this.dims = [
      ...data.axes.map((axis, k) => ({
        ...axis, id: axis.name, levels: axis.words, discrete: true,
        at: (row) => (axis.numbers ? axis.numbers[data.levels[k][row]] : data.levels[k][row]), level: (row) => data.levels[k][row],
      })),
      ...data.metrics.map((metric) => ({...metric, id: `metric ${metric.name}`, at: (row) => metric.values[row]})),
    ];
    for (const dim of this.dims) {
      dim.range = dim.discrete && !dim.numbers ? [0, dim.words.length - 1] : extremes(this.rows.map(dim.at).filter((one) => one !== null));
      if (!(dim.range[0] <= dim.range[1])) dim.range = [0, 1];
      if (!dim.discrete && dim.range[0] > 0 && dim.range[0] < 0.4 * dim.range[1]) dim.range = [0, dim.range[1]];
      if (dim.range[0] === dim.range[1]) dim.range = [dim.range[0] - 0.5, dim.range[1] + 0.5];
    }
    this.fill();
    this.state = this.initial();
    this.restore();
    this.listen();
    this.refresh();
    if (this.state.open.length) this.show();
    performance.mark('ys-drawn');
    root.classList.add('ys-ready');
  }

  // ---- state ----

  initial() {
    const {data} = this;
    const [x = '', y = '', panel = ''] = data.map;
    const state = {metric: data.metric, limit: data.limits[data.metric]?.bound ?? null, x, y, panel, fixed: {}, brush: {}, open: []};
    const cells = [x, y, panel].reduce((product, name) => product * (this.axis(name)?.words.length || 1), 1);
    if (panel && cells > MOST_CELLS && data.grid) state.fixed[panel] = 0;
    for (const dim of this.others(state)) if (!dim.repeats && !dim.drawn) state.fixed[dim.id] = 0;
    return state;
  }

  // The keys are one text, each as long as the others.
  sideKey(row) {
    const {keys} = this.data;
    const length = keys.length / this.count;
    return keys.slice(row * length, (row + 1) * length).trim();
  }

  kinds() {
    const isAxis = (v) => v === '' || Boolean(this.axis(v));
    return {
      metric: (v) => this.data.metrics.some((one) => one.name === v), limit: (v) => v === null || Number.isFinite(v),
      x: isAxis, y: isAxis, panel: isAxis,
      fixed: (v) => v && Object.entries(v).every(([name, k]) => this.axis(name)?.words[k] !== undefined),
      brush: (v) => v && Object.entries(v).every(([id, ends]) => this.dim(id) && Array.isArray(ends) && ends.length === 2 && ends.every(Number.isFinite)),
      open: (v) => Array.isArray(v) && v.every((row) => Number.isInteger(row) && row >= 0 && row < this.count),
    };
  }

  dim(id) { return this.dims.find((one) => one.id === id); }

  axis(name) { return this.dims.find((one) => one.discrete && one.id === name); }

  // Axes that the map does not show.
  others({x, y, panel}) { return this.dims.filter((one) => one.discrete && ![x, y, panel].includes(one.id)); }

  get metric() { return this.dim(`metric ${this.state.metric}`); }

  get atMost() { return this.data.limits[this.state.metric]?.at_most ?? true; }

  // Whether a run is within the limit; one without a number is not.
  within(row) {
    const {limit} = this.state;
    if (limit === null || !this.metric) return true;
    const value = this.metric.at(row);
    return value !== null && (this.atMost ? value <= limit : value >= limit);
  }

  chosen(row) {
    return Object.entries(this.state.brush).every(([id, [low, high]]) => {
      const value = this.dim(id).at(row);
      return value !== null && value >= low && value <= high;
    });
  }

  // ---- words ----

  text(value, dim, digits = 3) { return value === null ? '–' : signed(digitsOf(value, digits)) + (dim.unit ? ` ${dim.unit}` : ''); }

  words(row) {
    return this.dims.filter((dim) => dim.discrete).map((dim) => {
      const word = dim.words[dim.level(row)];
      return dim.numbers ? `${dim.label} ${word}${dim.unit ? ` ${dim.unit}` : ''}` : word;
    }).join(', ');
  }

  title(row) {
    const value = this.metric ? this.metric.at(row) : null;
    const said = this.metric ? `: ${this.metric.label} ${this.text(value, this.metric)}` : '';
    return `Run ${row + 1}, ${this.words(row)}${said}${value === null || this.within(row) ? '' : ', beyond the limit'}`;
  }

  told(row) {
    const {data} = this;
    const why = data.told[row] ? `; ${data.told[row]}` : '';
    return `${this.title(row)}; ${data.statuses[data.status[row]]}${why}; ${data.sides[row] ? 'results kept' : 'results not kept'}.`;
  }

  // The command that makes a run.
  command(row) {
    const {data} = this;
    const run = data.of_run[row];
    const [program, verb, scenario, ...base] = data.base[run];
    const other = data.axes.map((axis, k) => axis.scenarios && axis.applies[run] && axis.scenarios[data.levels[k][row]]).filter(Boolean);
    const more = data.axes.flatMap((axis, k) => (axis.options && axis.applies[run] ? axis.options[data.levels[k][row]] : []));
    return [program, verb, other.at(-1) ?? scenario, ...base, ...more].join(' ');
  }

  // ---- drawing ----

  fill() {
    const {data, find} = this;
    find('metric').append(...data.metrics.map((one) => new Option(inUnit(one), one.name)));
    const axes = this.dims.filter((dim) => dim.discrete);
    for (const name of ['x', 'y', 'panel']) {
      const offered = name === 'panel' ? axes.filter((dim) => !dim.drawn) : axes;
      find(name).append(...(name === 'x' ? [] : [new Option('–', '')]), ...offered.map((dim) => new Option(dim.label, dim.id)));
    }
  }

  refresh() {
    const {state, find, metric} = this;
    for (const name of ['metric', 'x', 'y', 'panel']) find(name).value = state[name];
    find('limit').parentElement.hidden = !metric;
    if (metric) {
      [find('limit').min, find('limit').max] = metric.range;
      find('limit').value = state.limit ?? metric.range[this.atMost ? 1 : 0];
      find('bound').value = state.limit ?? '';
      find('unit').textContent = metric.unit;
      find('limit').setAttribute('aria-valuetext', state.limit === null ? 'no limit' : this.text(state.limit, metric));
    }
    const selects = [this.axis(state.panel), ...this.others(state)].filter((dim) => dim && !dim.drawn).map((dim) => {
      const label = made('label', `${dim.label} `);
      const select = made('select');
      select.dataset.axis = dim.id;
      select.append(new Option(dim.id === state.panel ? 'all' : 'mean', ''), ...dim.words.map((word, k) => new Option(word, k)));
      select.value = state.fixed[dim.id] ?? '';
      label.append(select);
      return label;
    });
    find('fixed').replaceChildren(...selects);
    this.draw();
  }

  draw() {
    this.visible = this.rows.filter((row) => this.chosen(row));
    this.isVisible = new Set(this.visible);
    const inside = this.visible.filter((row) => this.within(row)).length;
    const brushed = Object.keys(this.state.brush).length ? `${this.visible.length} of ${this.count} chosen` : '';
    const held = this.state.limit === null || !this.metric ? '' : `${inside} of ${this.visible.length} within ${this.state.limit} ${this.metric.unit}`;
    this.find('chosen').textContent = [brushed, held].filter(Boolean).join('; ') + (brushed || held ? '.' : '');
    this.drawMap();
    this.drawLines();
    clearTimeout(this.later);
    this.later = setTimeout(() => this.remember(), 150);
  }

  // The cells of all maps: those of a grid have a level of x and y each; else a point each.
  cells() {
    const {state} = this;
    const [x, y, panel] = [state.x, state.y, state.panel].map((name) => this.axis(name));
    const fixed = Object.entries(state.fixed).map(([name, k]) => [this.axis(name), k]);
    const found = new Map();
    for (const row of this.rows) {
      if (fixed.some(([dim, k]) => dim.level(row) !== k)) continue;
      const place = [x, y, panel].map((dim) => (dim ? dim.level(row) : 0));
      const name = this.data.grid ? place.join() : String(row);
      if (!found.has(name)) found.set(name, {place, rows: []});
      found.get(name).rows.push(row);
    }
    for (const cell of found.values()) {
      const values = this.metric ? cell.rows.map(this.metric.at).filter((one) => one !== null) : [];
      cell.value = values.length === cell.rows.length ? values.reduce((sum, one) => sum + one, 0) / values.length : null;
      cell.made = cell.rows.every((row) => this.data.made[this.data.status[row]]);
      cell.within = !cell.made || cell.rows.every((row) => this.within(row));
      cell.chosen = cell.rows.some((row) => this.isVisible.has(row));
    }
    return [...found.values()];
  }

  drawMap() {
    const {state} = this;
    const holder = this.find('map');
    const wide = Math.max(holder.clientWidth, 240);
    const [x, y, panel] = [state.x, state.y, state.panel].map((name) => this.axis(name));
    const cells = this.cells();
    const maps = panel ? (state.fixed[panel.id] === undefined ? panel.words.map((_, k) => k) : [state.fixed[panel.id]]) : [0];
    const scattered = !this.data.grid;
    const [across, up] = [x, y].map((dim) => (!scattered && dim ? dim.words.length : 1));
    const ends = (dim) => (!dim ? [] : dim.numbers ? dim.range.map((one, k) => [k, signed(digitsOf(one, 3))]) : dim.words.map((word, k) => [(k + 0.5) / dim.words.length, word]));
    const left = 12 + 6.6 * Math.max(...(scattered ? ends(y).map(([, word]) => word.length) : y ? y.words.map((word) => word.length) : [0]), 2);
    let beside = Math.min(maps.length, 4);
    while (beside > 1 && (wide / beside - left) / across < (scattered ? 160 : 28)) beside -= 1;
    const frame = wide / beside;
    const cw = (frame - left - 8) / across;
    const labels = new Map(cells.map((cell) => [cell, this.label(cell)]));
    const longest = Math.max(...[...labels.values()].map((label) => label.length), 1);
    const numbers = this.data.grid && longest * 5.7 + 2 <= cw && cells.length <= MOST_NUMBERS;
    const ch = !scattered ? Math.max(numbers ? 22 : 9, Math.min(30, 300 / up)) : 300;
    const top = 24;
    const high = top + up * ch + 40;
    const shapes = new Map(); // look -> path
    const add = (look, path) => shapes.set(look, (shapes.get(look) || '') + path);
    const texts = [];
    this.places = [];
    for (const cell of cells) {
      const at = maps.indexOf(cell.place[2]);
      if (at < 0) continue;
      const [x0, y0] = [(at % beside) * frame + left, Math.floor(at / beside) * high + top];
      let [px, py, w, h] = [x0 + cell.place[0] * cw, y0 + (up - 1 - cell.place[1]) * ch, cw - 1, ch - 1];
      if (!this.data.grid) {
        const to = (dim, size) => (dim ? (dim.numbers ? partOf(dim, dim.at(cell.rows[0])) : (dim.level(cell.rows[0]) + 0.5) / dim.words.length) : 0.5) * size;
        [px, py, w, h] = [x0 + to(x, across * cw - 8), y0 + up * ch - 8 - to(y, up * ch - 8), 8, 8];
      }
      const shade = cell.value === null ? 'none' : this.shade(cell.value);
      add(`${cell.within ? 'within' : 'beyond'} ${shade} ${cell.chosen ? '' : 'pale'}`, `M${px.toFixed(1)} ${py.toFixed(1)}h${w.toFixed(1)}v${h.toFixed(1)}h${(-w).toFixed(1)}z`);
      if (!cell.within && this.data.grid) add('corner', `M${(px + w - 7).toFixed(1)} ${py.toFixed(1)}h7v7z`);
      if (numbers) texts.push(`<text x="${(px + w / 2).toFixed(1)}" y="${(py + h / 2 + 4).toFixed(1)}" text-anchor="middle"${cell.chosen ? '' : ' class="ys-pale"'} font-size="${longest * 6.6 + 4 > cw ? 10 : 12}">${labels.get(cell)}</text>`);
      this.places.push({cell, px, py, w, h, map: at});
    }
    const paths = [...shapes].map(([look, path]) => {
      if (look === 'corner') return `<path class="ys-corner" d="${path}"/>`;
      const [kind, shade, pale] = look.split(' ');
      if (shade === 'none') return `<path class="ys-none${pale ? ' ys-pale' : ''}" d="${path}"/>`;
      return `<path class="ys-${kind}${pale ? ' ys-pale' : ''}" fill-opacity="${opacityOf(Number(shade))}" d="${path}"/>`;
    });
    const heads = maps.map((k, at) => {
      const [x0, y0] = [(at % beside) * frame + left, Math.floor(at / beside) * high + top];
      const title = panel ? `${panel.numbers ? `${panel.label} ` : ''}${panel.words[k]}${panel.unit ? ` ${panel.unit}` : ''}` : '';
      const every = x ? Math.ceil((6.6 * Math.max(...x.words.map((word) => word.length)) + 6) / cw) : 1;
      const named = x && this.data.grid && every <= across / 2; // else they are cut at the sides
      const below = named ? x.words.map((word, i) => (i % every ? '' : `<text class="ys-quiet" x="${(x0 + (i + 0.5) * cw).toFixed(1)}" y="${(y0 + up * ch + 13).toFixed(1)}" text-anchor="middle" font-size="11">${escaped(word)}</text>`)).join('') : '';
      const border = scattered ? `<path class="ys-frame" d="M${x0} ${y0}v${ch}h${(cw - 0.5).toFixed(1)}"/>` : '';
      const marks = !scattered ? '' : ends(x).map(([part, word]) => `<text class="ys-quiet" x="${(x0 + part * cw).toFixed(1)}" y="${y0 + ch + 13}" text-anchor="${part === 0 ? 'start' : part === 1 ? 'end' : 'middle'}" font-size="11">${escaped(word)}</text>`).join('')
        + ends(y).map(([part, word]) => `<text class="ys-quiet" x="${x0 - 5}" y="${(y0 + ch - part * (ch - 10)).toFixed(1)}" text-anchor="end" font-size="11">${escaped(word)}</text>`).join('');
      const steps = Math.ceil(13 / ch);
      const aside = y && this.data.grid ? y.words.map((word, j) => (j % steps ? '' : `<text class="ys-quiet" x="${(x0 - 5).toFixed(1)}" y="${(y0 + (up - 0.5 - j) * ch + 4).toFixed(1)}" text-anchor="end" font-size="11">${escaped(word)}</text>`)).join('') : '';
      return `<text x="${x0}" y="${y0 - 8}" font-weight="600">${escaped(title)}${y ? `<tspan class="ys-quiet" font-weight="400">${title ? '; ' : ''}up: ${escaped(inUnit(y))}</tspan>` : ''}</text>${border}${marks}${below}${aside}`
        + (x ? `<text class="ys-quiet" x="${x0}" y="${y0 + up * ch + 29}">right: ${escaped(inUnit(x))}${named || scattered ? '' : `, ${across} values`}</text>` : '');
    });
    const total = Math.ceil(maps.length / beside) * high;
    holder.innerHTML = `<svg viewBox="0 0 ${wide} ${total + 36}" aria-hidden="true">${paths.join('')}${heads.join('')}${texts.join('')}`
      + `${this.metric ? this.legend(total + 12) : ''}<path class="ys-open"/><path class="ys-cursor"/></svg>`;
    this.mark();
  }

  // The scale of all maps: the shades from the smallest value to the largest, and the limit between its two sides.
  legend(y) {
    const {metric, state: {limit}} = this;
    const [low, high] = metric.range;
    const between = limit !== null && limit > low && limit < high;
    const sides = limit === null ? ['within'] : between ? (this.atMost ? ['within', 'beyond'] : ['beyond', 'within']) : [(limit >= high) === this.atMost ? 'within' : 'beyond'];
    const numbers = [low, ...(between ? [limit] : []), high].map((one) => (one === limit ? signed(String(limit)) : this.inCell(one)));
    const words = `${inUnit(metric)}, all maps${limit === null ? '' : '; ◥ orange: beyond the limit'}`;
    let x = 0;
    const parts = [`<text class="ys-quiet" x="0" y="${y}">${escaped(words)}</text>`];
    const number = (text) => {
      parts.push(`<text class="ys-quiet" x="${x}" y="${y + 17}" font-size="11">${escaped(text)}</text>`);
      x += 6.6 * text.length + 6;
    };
    number(numbers[0]);
    sides.forEach((side, k) => {
      for (let shade = 0; shade < SHADES; shade++) parts.push(`<path class="ys-${side}" fill-opacity="${opacityOf(shade)}" d="M${x + 14 * shade} ${y + 7}h13v11h-13z"/>`);
      x += 14 * SHADES + 6;
      number(numbers[k + 1]);
    });
    return parts.join('');
  }

  label({value, made}) {
    return made ? this.inCell(value) : '–';
  }

  // A number in a cell: short, but never as the limit reads if it is another.
  inCell(value) {
    if (value === null) return '✗';
    const {range} = this.metric;
    const size = Math.max(Math.abs(range[0]), Math.abs(range[1]));
    if (size < 3 || size >= 1e5) return signed(digitsOf(value, 2));
    let decimals = Math.abs(value) < 99.95 && size < 1000 ? 1 : 0;
    while (decimals < 4 && value !== this.state.limit && Number(value.toFixed(decimals)) === this.state.limit) decimals += 1;
    return decimal(value, decimals);
  }

  // The shade of a value, between the end of its side of the limit and the limit.
  shade(value) {
    const {limit} = this.state;
    const [low, high] = this.metric.range;
    if (limit === null) return Math.min(SHADES - 1, Math.floor((SHADES * (value - low)) / (high - low)));
    const [from, to] = value <= limit ? [low, limit] : [limit, high];
    return to > from ? Math.min(SHADES - 1, Math.max(0, Math.floor(SHADES * Math.sqrt((value - from) / (to - from))))) : 0;
  }

  // Outline the open cells and that of the cursor.
  mark() {
    const outline = (places) => places.map(({px, py, w, h}) => `M${px} ${py}h${w}v${h}h${-w}z`).join('');
    const open = new Set(this.state.open);
    this.find('map').querySelector('.ys-open').setAttribute('d', outline(this.places.filter(({cell}) => cell.rows.some((row) => open.has(row)))));
    const here = this.places.filter((one) => one.cell.rows.includes(this.row));
    this.find('map').querySelector('.ys-cursor').setAttribute('d', outline(here));
    const above = this.find('lines').querySelector('.ys-above');
    if (above) above.setAttribute('d', (this.row === undefined ? [] : [this.row]).concat(this.state.open).map((row) => this.line(row)).join(''));
  }

  // Columns of the parallel coordinates that fit: all axes, then the shown metric, then others.
  columns(wide) {
    const fit = Math.max(3, Math.floor(wide / (wide < 500 ? 62 : 92)));
    const axes = this.dims.filter((dim) => dim.discrete && dim.words.length > 1);
    const metrics = this.dims.filter((dim) => !dim.discrete && dim !== this.metric);
    const brushed = new Set(Object.keys(this.state.brush));
    const wanted = [...axes, this.metric, ...metrics].filter(Boolean);
    const kept = new Set(wanted.filter((dim, k) => k < fit || brushed.has(dim.id)));
    return [...axes, ...this.dims.filter((dim) => !dim.discrete)].filter((dim) => kept.has(dim));
  }

  high(dim, value) {
    if (value === null || value === undefined) return LINES_HIGH - 12;
    return 58 + (LINES_HIGH - 96) * (1 - partOf(dim, value));
  }

  line(row) { return 'M' + this.shownDims.map((dim, k) => `${this.xs[k]} ${this.high(dim, dim.at(row)).toFixed(1)}`).join('L'); }

  drawLines() {
    const holder = this.find('lines');
    const wide = Math.max(holder.clientWidth, 240);
    const focused = holder.contains(document.activeElement) ? document.activeElement.dataset.dim : undefined;
    const dims = this.shownDims = this.columns(wide);
    const edge = wide < 500 ? 30 : 48;
    this.xs = dims.map((_, k) => Number((edge + (dims.length > 1 ? (k * (wide - 2 * edge)) / (dims.length - 1) : 0)).toFixed(1)));
    const colour = dims.find((dim) => dim.discrete && !dim.numbers && dim.words.length <= BESIDE_RUNS);
    const groups = new Map();
    for (const row of this.rows) {
      const look = this.isVisible.has(row) ? (colour ? colour.level(row) : 0) : 'left';
      if (!groups.has(look)) groups.set(look, []);
      groups.get(look).push(this.line(row));
    }
    const opacity = Math.min(0.85, Math.max(0.12, 90 / this.visible.length));
    const dashes = ['', '5 2', '2 2', '7 2 2 2', '1 3', '9 3', '4 1 1 1'];
    const paths = [...groups].sort(([one], [other]) => (other === 'left') - (one === 'left')).map(([look, lines]) => (look === 'left'
      ? `<path class="ys-line ys-left" d="${lines.join('')}"/>`
      : `<path class="ys-line" stroke="var(--yv-run-${look})" stroke-opacity="${opacity.toFixed(2)}" stroke-dasharray="${this.count <= 400 ? dashes[look] : ''}" d="${lines.join('')}"/>`));
    const axes = dims.map((dim, k) => {
      const x = this.xs[k];
      const brush = this.state.brush[dim.id];
      const label = inUnit(dim);
      const step = dims.length > 1 ? this.xs[1] - this.xs[0] : wide;
      const last = k === dims.length - 1 && k > 0;
      const room = Math.max(8, Math.floor((k === 0 || last ? edge + step / 2 - 8 : step - 6) / 6.6)); // characters beside the neighbours
      const lines = wrapped(label, room, 3);
      const named = dim.words && (!dim.numbers || dim.words.length <= 6);
      const every = Math.ceil((dim.words?.length ?? 0) / MOST_NAMES);
      const ends = named ? dim.words.map((word, i) => [dim.numbers ? dim.numbers[i] : i, word]).filter((_, i) => i % every === 0) : dim.range.map((one, i) => [one, dim.words ? dim.words.at(-i) : signed(digitsOf(one, 3))]);
      const left = last && Math.max(...ends.map(([, word]) => word.length)) * 6.2 > edge - 8;
      const ticks = ends.map(([value, word]) => `<text x="${x + (left ? -6 : 6)}" y="${(this.high(dim, value) + (value === dim.range[0] ? -3 : value === dim.range[1] ? 11 : 4)).toFixed(1)}" font-size="11" text-anchor="${left ? 'end' : 'start'}" paint-order="stroke" stroke="var(--yv-ground)" stroke-width="3">${escaped(wrapped(word, Math.max(8, Math.floor((left || k === dims.length - 2 ? step / 2 : step) / 6.4)), 1)[0])}</text>`);
      const limit = dim === this.metric && this.state.limit !== null && this.state.limit >= dim.range[0] && this.state.limit <= dim.range[1]
        ? `<path class="ys-bar-limit" d="M${x - 12} ${this.high(dim, this.state.limit).toFixed(1)}h24"/>` : '';
      const [a, b] = brush ? [this.high(dim, Math.min(brush[1], dim.range[1])), this.high(dim, Math.max(brush[0], dim.range[0]))] : [0, 0];
      const said = brush ? `${signed(digitsOf(brush[0], 3))} to ${signed(digitsOf(brush[1], 3))}` : 'all';
      const anchor = k === 0 ? 'start' : last ? 'end' : 'middle';
      const tx = k === 0 ? 2 : last ? wide - 2 : x;
      return `<g class="ys-axis" tabindex="0" role="slider" data-dim="${escaped(dim.id)}" aria-orientation="vertical" aria-label="${escaped(label)}" aria-valuemin="${dim.range[0]}" aria-valuemax="${dim.range[1]}" aria-valuenow="${brush ? brush[1] : dim.range[1]}" aria-valuetext="${escaped(said)}">`
        + `<line x1="${x}" x2="${x}" y1="58" y2="${LINES_HIGH - 38}"/>${brush ? `<rect x="${x - 7}" width="14" y="${(a - 3).toFixed(1)}" height="${(b - a + 6).toFixed(1)}"/>` : ''}${limit}`
        + lines.map((one, i) => `<text x="${tx}" y="${44 - 14 * (lines.length - 1 - i)}" text-anchor="${anchor}">${escaped(one)}</text>`).join('') + `${ticks.join('')}</g>`;
    });
    const lost = this.rows.some((row) => dims.some((dim) => dim.at(row) === null));
    holder.innerHTML = `<svg viewBox="0 0 ${wide} ${LINES_HIGH}">${paths.join('')}<path class="ys-above"/>${axes.join('')}`
      + (lost ? `<text class="ys-quiet" x="${wide - 2}" y="${LINES_HIGH - 20}" text-anchor="end" font-size="11">lowest: no number</text>` : '') + '</svg>';
    if (focused !== undefined) holder.querySelector(`[data-dim="${CSS.escape(focused)}"]`)?.focus();
    this.mark();
  }

  // ---- what the reader does ----

  listen() {
    const {find} = this;
    const until = {passive: false};
    const change = (name, action) => find(name).addEventListener('change', (event) => action(event.target.value));
    change('metric', (value) => { Object.assign(this.state, {metric: value, limit: this.data.limits[value]?.bound ?? null}); this.refresh(); });
    for (const name of ['x', 'y', 'panel']) {
      change(name, (value) => {
        const state = this.state;
        for (const other of ['x', 'y', 'panel']) if (other !== name && state[other] === value) state[other] = other === 'panel' && this.axis(state[name])?.drawn ? '' : state[name];
        state[name] = value;
        state.fixed = {};
        for (const dim of this.others(state)) if (!dim.repeats && !dim.drawn) state.fixed[dim.id] = 0;
        this.refresh();
      });
    }
    const setLimit = (text) => { this.state.limit = text === '' || !Number.isFinite(Number(text)) ? null : Number(Number(text).toPrecision(4)); };
    find('limit').addEventListener('input', (event) => { setLimit(event.target.value); find('bound').value = this.state.limit; this.soon(); });
    change('bound', (value) => { setLimit(value); this.refresh(); });
    find('fixed').addEventListener('change', ({target}) => {
      if (target.value === '') delete this.state.fixed[target.dataset.axis]; else this.state.fixed[target.dataset.axis] = Number(target.value);
      this.draw();
    });
    find('clear').addEventListener('click', () => { this.state.brush = {}; this.draw(); });
    find('csv').addEventListener('click', () => saveFile(new Blob([this.csv()], {type: 'text/csv'}), `${this.key}.csv`));
    find('link').addEventListener('click', (event) => { this.remember(); copyAddress(event.target); });
    const map = find('map');
    map.addEventListener('pointermove', (event) => this.point(this.cellAt(event)));
    map.addEventListener('pointerleave', () => this.point(undefined));
    map.addEventListener('click', (event) => this.open(this.cellAt(event), event.shiftKey));
    map.addEventListener('keydown', (event) => this.pressedMap(event));
    const lines = find('lines');
    lines.addEventListener('pointerdown', (event) => this.beginBrush(event), until);
    lines.addEventListener('pointermove', (event) => { if (!this.brushing) this.point(this.lineAt(event)); });
    lines.addEventListener('pointerleave', () => this.point(undefined));
    lines.addEventListener('keydown', (event) => this.pressedAxis(event));
    addEventListener('hashchange', () => { if (this.restore()) { this.refresh(); this.show(); } });
    new ResizeObserver(() => { if (this.root.clientWidth !== this.wide) { this.wide = this.root.clientWidth; this.draw(); } }).observe(this.root);
    this.wide = this.root.clientWidth;
    for (const [event, printing] of [['beforeprint', true], ['afterprint', false]]) {
      addEventListener(event, () => { this.root.classList.toggle('ys-print', printing); this.draw(); });
    }
  }

  soon() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  place(event) {
    const svg = event.currentTarget.querySelector('svg');
    const box = svg.getBoundingClientRect();
    const scale = svg.viewBox.baseVal.width / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
  }

  cellAt(event) {
    const [x, y] = this.place(event);
    const found = this.places.find(({px, py, w, h}) => x >= px && x <= px + w + 1 && y >= py && y <= py + h + 1);
    return found && this.rowOf(found.cell);
  }

  // The run that a cell opens: of repeats, the worst.
  rowOf(cell) {
    const sign = this.atMost ? 1 : -1;
    const rank = (row) => (this.metric?.at(row) ?? Infinity * sign) * sign;
    return cell.rows.reduce((best, row) => (rank(row) > rank(best) ? row : best));
  }

  lineAt(event) {
    const [x, y] = this.place(event);
    const k = Math.max(0, Math.min(this.xs.length - 2, this.xs.findLastIndex((one) => one <= x)));
    if (this.xs.length < 2) return undefined;
    const part = (x - this.xs[k]) / (this.xs[k + 1] - this.xs[k]);
    let [best, least] = [undefined, NEAR_LINE];
    for (const row of this.visible) {
      const [a, b] = [k, k + 1].map((n) => this.high(this.shownDims[n], this.shownDims[n].at(row)));
      const far = Math.abs(a + part * (b - a) - y);
      if (far < least) [best, least] = [row, far];
    }
    return best;
  }

  point(row) {
    if (row === this.row) return;
    this.row = row;
    this.find('told').textContent = row === undefined ? '' : this.told(row);
    this.mark();
  }

  pressedMap(event) {
    const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
    if (event.key === 'Enter' && this.row !== undefined) { event.preventDefault(); this.open(this.row, event.shiftKey); return; }
    if (!steps[event.key] || !this.places.length) return;
    event.preventDefault();
    const here = this.places.find(({cell}) => cell.rows.includes(this.row));
    if (!here) { this.point(this.rowOf(this.places[0].cell)); return; }
    const [dx, dy] = steps[event.key];
    let [best, least] = [null, Infinity];
    for (const one of this.places) {
      const [x, y] = [one.px - here.px, here.py - one.py];
      const ahead = dx * x + dy * y;
      const far = Math.abs(ahead) + 3 * Math.abs(dy * x + dx * y);
      if (ahead > 0.5 && far < least) [best, least] = [one, far];
    }
    if (best) this.point(this.rowOf(best.cell));
  }

  setBrush(dim, ends) {
    const [low, high] = dim.range;
    if (!ends || (ends[0] <= low && ends[1] >= high)) delete this.state.brush[dim.id];
    else this.state.brush[dim.id] = [Math.max(ends[0], low), Math.min(ends[1], high)].map((one) => Number(one.toPrecision(6)));
    this.draw();
  }

  beginBrush(event) {
    const [x, y] = this.place(event);
    const k = this.xs.findIndex((one) => Math.abs(one - x) < NEAR_LINE);
    const holder = event.currentTarget;
    if (k < 0) {
      const row = this.lineAt(event);
      if (row !== undefined) this.open(row, event.shiftKey);
      return;
    }
    event.preventDefault();
    const dim = this.shownDims[k];
    const value = (at) => {
      const [low, top] = dim.log ? dim.range.map(Math.log) : dim.range;
      const found = low + (top - low) * (1 - (at - 58) / (LINES_HIGH - 96));
      return dim.log ? Math.exp(found) : found;
    };
    this.brushing = true;
    holder.setPointerCapture(event.pointerId);
    const moved = (one) => {
      const box = holder.querySelector('svg').getBoundingClientRect();
      const to = (one.clientY - box.top) * (LINES_HIGH / box.height);
      this.setBrush(dim, Math.abs(to - y) < 3 ? null : [value(Math.max(y, to)), value(Math.min(y, to))]);
    };
    const ended = () => {
      this.brushing = false;
      holder.removeEventListener('pointermove', moved);
    };
    holder.addEventListener('pointermove', moved);
    holder.addEventListener('pointerup', ended, {once: true});
    holder.addEventListener('pointercancel', ended, {once: true});
    this.setBrush(dim, null);
  }

  pressedAxis(event) {
    const dim = this.dim(event.target.dataset.dim);
    if (!dim) return;
    const way = {ArrowUp: 1, ArrowDown: -1}[event.key];
    const along = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    if (event.key === 'Enter') this.open(this.row, event.shiftKey);
    else if (along) this.next(dim, along);
    else if (event.key === 'Delete' || event.key === 'Escape' || event.key === 'Backspace') this.setBrush(dim, null);
    else if (!way) return;
    else {
      const ends = [...(this.state.brush[dim.id] || dim.range)];
      const end = event.shiftKey ? 0 : 1;
      const stops = dim.words ? (dim.numbers || dim.words.map((_, k) => k)) : Array.from({length: 21}, (_, k) => dim.range[0] + ((dim.range[1] - dim.range[0]) * k) / 20);
      const next = way > 0 ? stops.find((one) => one > ends[end] + 1e-9) : stops.findLast((one) => one < ends[end] - 1e-9);
      if (next !== undefined) ends[end] = next;
      if (ends[0] <= ends[1]) this.setBrush(dim, ends);
    }
    event.preventDefault();
  }

  // Point at the line above (1) or below (-1) on an axis; lost runs lie below all others.
  next(dim, way) {
    const height = (row) => dim.at(row) ?? -Infinity;
    const order = [...this.visible].sort((a, b) => height(a) - height(b) || a - b);
    const at = order.indexOf(this.row);
    this.point(order[at < 0 ? (way > 0 ? 0 : order.length - 1) : Math.min(Math.max(at + way, 0), order.length - 1)]);
  }

  csv() {
    const {data} = this;
    const head = ['run', ...this.dims.map((dim) => `${dim.discrete ? dim.id : dim.name}${dim.unit ? ` [${dim.unit}]` : ''}`), 'status', 'key'];
    const lines = this.visible.map((row) => [row + 1, ...this.dims.map((dim) => (dim.discrete && !dim.numbers ? dim.words[dim.level(row)] : dim.at(row) ?? '')), data.statuses[data.status[row]], this.sideKey(row)]);
    return [head, ...lines].map((line) => line.map(quoted).join(',')).join('\n') + '\n';
  }

  // Open a run in the viewer, with those that differ from it only in the names of the maps; `more`: beside those open.
  open(row, more) {
    if (row === undefined) return;
    const apart = this.dims.filter((dim) => dim.discrete && !(dim.id === this.state.panel && !dim.numbers));
    const alike = this.rows.filter((one) => one !== row && this.data.sides[one] && apart.every((dim) => dim.level(one) === dim.level(row)));
    const wanted = more ? [...this.state.open, row] : [...(this.data.sides[row] ? alike : []), row];
    this.state.open = [...new Set(wanted)].slice(-BESIDE_RUNS);
    this.show();
    this.mark();
    this.remember();
  }

  // The open runs in the viewer; of those whose results are not kept, the command.
  async show() {
    const {open} = this.state;
    const [title, remark] = [this.root.querySelector('.ys-run > h3'), this.find('remark')];
    title.hidden = !open.length;
    title.setAttribute('aria-level', headingLevel(title));
    title.textContent = open.length ? this.title(open.at(-1)) : '';
    const kept = open.filter((row) => this.data.sides[row]);
    remark.replaceChildren();
    for (const row of open.filter((one) => !this.data.sides[one])) {
      const words = `Results of run ${row + 1} are not kept (keep: all, or --keep, keeps those of all runs). This makes the run:`;
      remark.append(made('p', words), made('pre', this.command(row)));
    }
    if (!kept.length) { clearViewer(this.find('run')); return; }
    try {
      const contents = await Promise.all(kept.map((row) => loadSide(this.data.folder, this.sideKey(row))));
      if (this.state.open === open) await showSides(this.find('run'), contents);
    } catch (error) {
      if (this.state.open !== open) return;
      remark.append(made('p', `${error.message}: it belongs beside this page.`));
    }
  }
}

// A text in lines of a width [characters]; the last one is cut.
function wrapped(text, width, most) {
  const lines = [''];
  for (const word of text.split(' ')) {
    const last = lines[lines.length - 1];
    if (!last) lines[lines.length - 1] = word;
    else if (last.length + word.length < width || lines.length === most) lines[lines.length - 1] = `${last} ${word}`;
    else lines.push(word);
  }
  return lines.map((line) => (line.length > width + 2 ? `${line.slice(0, width)}…` : line));
}

async function startSweeps() {
  for (const root of document.querySelectorAll('.ys')) root.sweep = new Sweep(root, JSON.parse(await unpacked(root.querySelector(':scope > script'))));
}

ready(startSweeps);
