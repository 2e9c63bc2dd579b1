// The view as a picture: drawn once, on a canvas for PNG or on paper that writes SVG.

const LINE_HIGH = 22; // of words in a picture [pixels]
const PICTURE_WIDE = 900;

// What of a canvas's context the drawings here use, written as SVG.
class SvgPaper {
  constructor() {
    Object.assign(this, {parts: [], clips: 0, open: [], saved: [], d: '', dash: [], measure: document.createElement('canvas').getContext('2d')});
    Object.assign(this, {strokeStyle: '#000', fillStyle: '#000', lineWidth: 1, font: FONT, textAlign: 'left', globalAlpha: 1});
  }

  save() {
    const {strokeStyle, fillStyle, lineWidth, font, textAlign, globalAlpha} = this;
    this.saved.push({strokeStyle, fillStyle, lineWidth, font, textAlign, globalAlpha});
    this.open.push(0);
  }

  restore() {
    Object.assign(this, this.saved.pop());
    this.parts.push('</g>'.repeat(this.open.pop()));
  }

  beginPath() { this.d = ''; }

  moveTo(x, y) { this.d += `M${x.toFixed(1)} ${y.toFixed(1)}`; }

  lineTo(x, y) { this.d += `${this.d ? 'L' : 'M'}${x.toFixed(1)} ${y.toFixed(1)}`; }

  rect(x, y, width, height) { this.d += `M${x} ${y}h${width}v${height}h${-width}z`; }

  fillRect(x, y, width, height) { this.parts.push(`<rect x="${x}" y="${y}" width="${width}" height="${height}" fill="${this.fillStyle}"/>`); }

  clip() {
    const name = `clip${this.clips++}`;
    this.parts.push(`<clipPath id="${name}"><path d="${this.d}"/></clipPath><g clip-path="url(#${name})">`);
    this.open[this.open.length - 1] += 1;
  }

  setLineDash(dash) { this.dash = dash; }

  stroke() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.map((one) => one.toFixed(1)).join(' ')}"` : '';
    this.parts.push(`<path d="${this.d}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" stroke-linejoin="round"${dash}/>`);
  }

  fill() { this.parts.push(`<path d="${this.d}" fill="${this.fillStyle}"/>`); }

  measureText(words) {
    this.measure.font = this.font;
    return this.measure.measureText(words);
  }

  strokeText() {} // the halo of words: see `fillText`

  fillText(words, x, y) {
    const anchor = {left: 'start', center: 'middle', right: 'end'}[this.textAlign];
    const size = parseFloat(this.font);
    this.parts.push(`<text x="${x.toFixed(1)}" y="${(y + 0.35 * size).toFixed(1)}" font-size="${size}" text-anchor="${anchor}" fill="${this.fillStyle}">${escaped(words)}</text>`);
  }

  text(width, height) {
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="system-ui, sans-serif">\n${this.parts.join('\n')}\n</svg>\n`;
  }
}

function escaped(words) { return String(words).replace(/[&<>"]/g, (one) => `&#${one.charCodeAt(0)};`); }

// Round numbers within a range, about as far apart as asked.
function splitsOf({min, max}, count) {
  let step = round((max - min) / Math.max(count, 1));
  if ((max - min) / step > 2 * count) step *= 2;
  const first = Math.ceil(min / step - 1e-9);
  return Array.from({length: Math.max(Math.floor(max / step + 1e-9) - first + 1, 0)}, (_, k) => (first + k) * step);
}

// Where everything of a picture stands: its title and legend in lines, its panels, its height.
function layoutOf(viewer, width) {
  const c = new SvgPaper();
  c.font = '13px system-ui, sans-serif';
  const [from, to] = viewer.span();
  const title = viewer.drawnInstead;
  let [x, y] = [8, title ? LINE_HIGH + 4 : 4];
  const legend = viewer.drawnRuns().map((run) => {
    const label = viewer.drawnLabel(run);
    const wide = 56 + c.measureText(label).width;
    if (x > 8 && x + wide > width) [x, y] = [8, y + LINE_HIGH];
    x += wide;
    return {run, label, x: x - wide, y: y + LINE_HIGH / 2};
  });
  y += legend.length ? LINE_HIGH : 0;
  const panels = viewer.panels.filter((panel) => panel.plot).map((panel) => {
    const height = panel.plot.over.clientHeight;
    y += LINE_HIGH + height + 6;
    const frame = {left: AXIS_WIDTH, top: y - height - 6, width: width - AXIS_WIDTH - 12, height, across: {min: from, max: to}, up: panel.plot.scales.y};
    return {panel, frame, head: y - height - 6 - LINE_HIGH / 2};
  });
  return {title, legend, panels, axis: y, height: y + 2 * LINE_HIGH};
}

function drawPicture(c, viewer, width, {title, legend, panels, axis, height}) {
  const {theme} = viewer;
  const words = {colour: theme.ink, size: 13, halo: false};
  const quiet = {colour: theme.quiet, size: 12, halo: false};
  c.lineJoin = 'round';
  c.fillStyle = theme.ground;
  c.fillRect(0, 0, width, height);
  if (title) text(c, title, 8, LINE_HIGH / 2 + 2, {...words, size: 15});
  for (const {run, label, x, y} of legend) {
    polyline(c, [x, x + 30], [y, y]);
    stroke(c, viewer.colour(run), 2.2, 1, viewer.dash(run));
    text(c, label, x + 36, y, words);
  }
  for (const {panel, frame, head} of panels) {
    const {left, top, width: wide, height: high, across, up} = frame;
    const down = top + high;
    text(c, panel.title, 8, head, words);
    const xs = splitsOf(across, wide / 70);
    const ys = splitsOf(up, high / 24);
    const toX = (value) => left + ((value - across.min) / (across.max - across.min)) * wide;
    const toY = (value) => down - ((value - up.min) / (up.max - up.min)) * high;
    for (const value of xs) { polyline(c, [toX(value), toX(value)], [top, down]); stroke(c, theme.line, 1, 1); }
    for (const value of ys) { polyline(c, [left, left + wide], [toY(value), toY(value)]); stroke(c, theme.line, 1, 1); }
    ticks(null, ys).forEach((word, i) => text(c, word, left - 6, toY(ys[i]), {...quiet, align: 'right'}));
    if (panel === panels.at(-1).panel) {
      ticks(null, xs).forEach((word, i) => text(c, word, toX(xs[i]), axis + 8, {...quiet, align: 'center'}));
      text(c, viewer.axisLabel, left + wide / 2, axis + 8 + LINE_HIGH, {...quiet, align: 'center'});
    }
    panel.behind(c, frame);
    c.save();
    c.beginPath();
    c.rect(left, top, wide, high);
    c.clip();
    for (const {run, xs: at, values, reference, colour} of panel.shown) {
      c.beginPath();
      traceLine(c, frame, at, values, panel.meaning.factor, panel.turn);
      if (run.band) {
        c.fillStyle = theme.band;
        c.fill();
      }
      stroke(c, colour, reference ? 5 : 1.7, 1, reference ? [] : viewer.dash(run));
    }
    c.restore();
    panel.above(c, frame, 1);
  }
}

// The view as a canvas, two of its pixels to one of the page.
function canvasOf(viewer, width = PICTURE_WIDE, ratio = 2) {
  const layout = layoutOf(viewer, width);
  const canvas = made('canvas', '', {width: width * ratio, height: Math.round(layout.height * ratio)});
  const c = canvas.getContext('2d');
  c.scale(ratio, ratio);
  drawPicture(c, viewer, width, layout);
  return canvas;
}

function svgOf(viewer, width = PICTURE_WIDE) {
  const paper = new SvgPaper();
  const layout = layoutOf(viewer, width);
  drawPicture(paper, viewer, width, layout);
  return paper.text(width, Math.round(layout.height));
}

// A command line; without runs that a folder has, ''.
function plotOf(runs, options) {
  if (!runs.length || runs.some(({folder}) => !folder)) return '';
  const word = (text) => (/^[\w./,=:~+@%-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
  return ['yawbench', 'plot', ...runs.map(({folder}) => folder), ...options].map(word).join(' ');
}

// The command that draws what is shown into a file, in the figures' own style; '' where figures have no such view.
function commandOf(viewer) {
  const {baseline, portrait, state: {x, difference, span, panels}} = viewer;
  const [from, to] = viewer.span();
  const timed = x === 'time' && span;
  const runs = viewer.runs.filter((run) => (viewer.shows(run) || (difference && run === baseline)) && !(timed && (run.end <= from || run.start >= to)));
  const names = panels.map((spec) => spec.split(',')[0]).map((name) => (portrait ? `${name}(${x})` : name));
  if (x === 'distance' || (portrait && (difference || names.some((name) => partsOf(name).length > 1)))) return '';
  return plotOf(runs, [
    ...runs.flatMap(({label}) => ['--label', label]), ...names.flatMap((name) => ['--panel', name]),
    ...(difference ? ['--minus', baseline.folder] : []), ...(timed ? ['--during', `${Number(from.toFixed(6))} to ${Number(to.toFixed(6))} s`] : []), '--format', 'svg',
  ]);
}
