// Controls, time, and what follows when it changes.

const ZOOM = [0.1, 8];

class Player {
  constructor(root) {
    this.root = root;
    const find = (name) => root.querySelector('.yb-' + name);
    const data = JSON.parse(root.querySelector('script[type="application/json"]').textContent);
    this.data = data;
    this.runs = data.runs.map(unpackRun);
    this.start = Math.min(...this.runs.map((run) => run.start));
    this.end = Math.max(...this.runs.map((run) => run.end));
    this.step = (this.end - this.start) / Math.max(...this.runs.map((run) => run.channels.time.length - 1), 1);
    this.time = data.still;
    this.touched = false; // until then, playing begins at the start
    this.playing = false;
    this.rate = 1;
    this.view = {camera: this.runs.length > 1 ? 'cars' : 0, zoom: 1};
    const moments = this.runs.map((run) => extremes(run.channels.yaw_moment || [], [0, 0]));
    this.strongest = Math.max(...moments.map(([low, high]) => Math.max(high, -low)));
    Object.assign(this, {
      scene: find('scene'), strip: find('strip'), slider: find('slider'), button: find('play'), clock: find('time'),
      closeUps: [...root.querySelectorAll('.yb-close canvas')],
      cells: [...root.querySelectorAll('.yb-readouts tbody tr')].map((row) => [...row.cells].slice(1)),
    });
    this.listen(find);
    this.draw();
    const calm = window.matchMedia('(prefers-reduced-motion: reduce)').matches;
    if (data.alone && !calm) this.play();
  }

  listen(find) {
    const {slider, strip, view} = this;
    [slider.min, slider.max, slider.step] = [this.start, this.end, 'any'];
    slider.addEventListener('input', () => this.seek(Number(slider.value)));
    this.button.addEventListener('click', () => this.toggle());
    find('rate').addEventListener('change', (event) => { this.rate = Number(event.target.value); });
    find('camera').addEventListener('change', (event) => {
      const chosen = event.target.value;
      view.camera = /^\d+$/.test(chosen) ? Number(chosen) : chosen;
      view.zoom = 1;
      this.draw();
    });
    find('in').addEventListener('click', () => this.zoom(1.25));
    find('out').addEventListener('click', () => this.zoom(0.8));
    strip.hidden = !this.data.strip;
    strip.addEventListener('pointerdown', (event) => {
      strip.setPointerCapture(event.pointerId);
      this.seek(timeUnder(strip, event, this.start, this.end));
    });
    strip.addEventListener('pointermove', (event) => {
      if (strip.hasPointerCapture(event.pointerId)) this.seek(timeUnder(strip, event, this.start, this.end));
    });
    const keys = this.data.alone ? document : this.root;
    keys.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(this.root);
    window.addEventListener('beforeprint', () => { this.pause(); this.draw(3); });
    window.addEventListener('afterprint', () => this.draw());
  }

  key(event) {
    const {tagName} = event.target;
    if (event.altKey || event.ctrlKey || event.metaKey || tagName === 'SELECT') return;
    const far = event.shiftKey ? 10 : 1;
    const actions = {
      ArrowLeft: () => this.seek(this.time - far * this.step),
      ArrowRight: () => this.seek(this.time + far * this.step),
      Home: () => this.seek(this.start),
      End: () => this.seek(this.end),
      '+': () => this.zoom(1.25),
      '-': () => this.zoom(0.8),
    };
    if (tagName !== 'BUTTON') actions[' '] = () => this.toggle();
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  zoom(factor) {
    this.view.zoom = Math.min(Math.max(this.view.zoom * factor, ZOOM[0]), ZOOM[1]);
    this.draw();
  }

  seek(time) {
    this.touched = true;
    this.pause();
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.draw();
  }

  toggle() {
    if (this.playing) this.pause(); else this.play();
  }

  play() {
    if (!this.touched || this.time >= this.end) this.time = this.start;
    this.touched = true;
    this.playing = true;
    this.button.textContent = 'Pause';
    let before = null;
    const next = (now) => {
      if (!this.playing) return;
      this.time = Math.min(this.time + (before === null ? 0 : ((now - before) / 1000) * this.rate), this.end);
      before = now;
      if (this.time >= this.end) this.pause();
      this.draw();
      if (this.playing) requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  pause() {
    this.playing = false;
    this.button.textContent = 'Play';
  }

  draw(density) {
    const {runs, time, data} = this;
    this.states = runs.map((run) => stateAt(run, time));
    drawScene(this.scene, density, runs, this.states, this.view, data.metres_per_newton);
    this.closeUps.forEach((canvas, i) => {
      drawCloseUp(canvas, density, runs[i], i, this.states[i], data.metres_per_newton, this.strongest);
    });
    if (data.strip) {
      const readout = data.readouts.find((one) => one.channel === data.strip);
      drawStrip(this.strip, density, runs, this.states, data.strip, readout, this.start, this.end, time);
    }
    this.tell();
  }

  tell() {
    this.slider.value = this.time;
    const words = `${this.time.toFixed(2)} s`;
    this.clock.textContent = words;
    this.slider.setAttribute('aria-valuetext', words);
    this.data.readouts.forEach(({channel, factor, decimals}, row) => {
      this.states.forEach((state, i) => {
        const value = state[channel];
        this.cells[row][i].textContent = Number.isFinite(value) ? decimal(value * factor, decimals) : '–';
      });
    });
  }
}

function startAll() {
  for (const root of document.querySelectorAll('.yb-animation')) {
    if (!root.player) root.player = new Player(root);
  }
}

if (document.readyState === 'loading') document.addEventListener('DOMContentLoaded', startAll);
else startAll();
