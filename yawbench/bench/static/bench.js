// The bench: sliders that ask the server for a run of the scenario with the changes, and the viewer of this run
// with the one before it and a pinned one as ghosts. At most one request is under way; of the changes made in the
// meantime, the latest is asked for next. The changes are in the address, as the viewer's state is.

const STALE = 600; // ms after which a request makes way for a later one, whose run ends its run
const served = new Map(); // address -> samples

async function samplesAt(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(await answer.text());
  return new Uint8Array(await answer.arrayBuffer());
}

bytesOf = ({dataset: {address}}) => {
  if (!served.has(address)) {
    served.set(address, samplesAt(address).catch((error) => { served.delete(address); throw error; }));
    if (served.size > 24) served.delete(served.keys().next().value);
  }
  return served.get(address);
};

class Bench {
  constructor(form) {
    this.form = form;
    this.title = form.querySelector('h1').textContent;
    this.find = (name) => form.querySelector('.' + name);
    this.facts = JSON.parse(this.find('facts').textContent);
    this.page = Math.random().toString(36).slice(2);
    this.before = null; // [key, label] of the runs that stay as ghosts
    this.pinned = null;
    this.now = null;
    this.restore();
    this.build();
    this.listen();
    this.ask();
  }

  restore() {
    const words = readAddress('bench') ?? new URLSearchParams();
    this.values = new Map(this.facts.shown.map((target) => [target, this.facts.knobs[target].value]));
    for (const text of words.getAll('set')) {
      const [target, value] = text.split('=');
      if (!(target in this.facts.knobs) || !Number.isFinite(parseFloat(value))) continue;
      const {factor} = this.facts.knobs[target]; // without a unit it is in SI
      this.values.set(target, parseFloat(value) * (Number.isFinite(Number(value)) ? factor : 1));
    }
    for (const text of words.getAll('swap')) {
      const [instance, fmu] = text.split('=');
      const select = [...this.form.querySelectorAll('.swap')].find((one) => one.dataset.instance === instance);
      if (select && [...select.options].some((one) => one.value === fmu)) select.value = fmu;
    }
    this.find('fault').value = words.get('fault') || '';
  }

  remember() {
    const words = new URLSearchParams();
    for (const text of this.changes.settings) words.append('set', text);
    for (const text of this.changes.swaps) words.append('swap', text);
    for (const text of this.changes.faults) words.append('fault', text);
    writeAddress('bench', words);
  }

  get changes() {
    const {knobs} = this.facts;
    const swaps = [...this.form.querySelectorAll('.swap')].filter((one) => !one.selectedOptions[0].defaultSelected);
    const fault = this.find('fault').value.trim();
    return {
      settings: [...this.values].filter(([target, value]) => value !== knobs[target].value).map(([target, value]) => `${target}=${value}${knobs[target].factor === 1 ? '' : ` ${knobs[target].unit}`}`),
      swaps: swaps.map((one) => `${one.dataset.instance}=${one.value}`),
      faults: /:\s*\S/.test(fault) ? [fault] : [],
    };
  }

  build() {
    const {knobs} = this.facts;
    this.find('sliders').replaceChildren(...[...this.values].map(([target, value]) => {
      const {unit, low, high, step, says, usual} = knobs[target];
      const holder = made('div', '', {className: 'knob'});
      const id = `knob-${target.replace(/\W/g, '-')}`;
      const slider = made('input', '', {type: 'range', id, min: low, max: high, step: 'any', value});
      const number = made('input', '', {type: 'number', step: 'any', value: Number(value.toPrecision(6))});
      const range = made('small', '', {className: 'quiet', title: usual ? 'usual range' : ''});
      holder.append(made('label', target, {title: says, htmlFor: id}), slider, number, range);
      number.setAttribute('aria-label', `${target}${unit ? ` in ${unit}` : ''}`);
      range.textContent = [...(usual ? [`${Number(low.toPrecision(3))} to ${Number(high.toPrecision(3))}`] : []), unit].join(' ').trim();
      slider.addEventListener('input', () => {
        const moved = Math.round((Number(slider.value) - low) / step) * step + low;
        number.value = Number(moved.toPrecision(6));
        this.set(target, Number(number.value));
      });
      number.addEventListener('change', () => {
        if (number.value === '' || !Number.isFinite(Number(number.value))) return;
        slider.value = number.value;
        this.set(target, Number(number.value));
      });
      return holder;
    }));
  }

  set(target, value) {
    this.values.set(target, value);
    this.ask();
  }

  listen() {
    this.form.addEventListener('submit', (event) => event.preventDefault());
    this.find('scenario').addEventListener('change', (event) => {
      location.href = `bench?scenario=${encodeURIComponent(event.target.value)}`;
    });
    this.find('more').addEventListener('change', ({target}) => {
      if (!(target.value in this.facts.knobs)) return;
      if (!this.values.has(target.value)) this.values.set(target.value, this.facts.knobs[target.value].value);
      target.value = '';
      this.build();
    });
    for (const select of this.form.querySelectorAll('.swap')) select.addEventListener('change', () => this.ask());
    this.find('fault').addEventListener('change', () => this.ask());
    this.find('pin').addEventListener('click', ({target}) => {
      this.pinned = this.pinned ? null : this.now;
      target.textContent = this.pinned ? 'Unpin' : 'Pin this run';
      target.setAttribute('aria-pressed', String(Boolean(this.pinned)));
      this.ask();
    });
    this.find('reset').addEventListener('click', () => {
      for (const target of this.values.keys()) this.values.set(target, this.facts.knobs[target].value);
      for (const select of this.form.querySelectorAll('.swap')) for (const option of select.options) option.selected = option.defaultSelected;
      this.find('fault').value = '';
      this.build();
      this.ask();
    });
  }

  ask() {
    this.waiting = true;
    if (!this.under) this.next();
    else if (performance.now() - this.began > STALE) this.under.abort();
  }

  async next() {
    while (this.waiting) {
      this.waiting = false;
      this.began = performance.now();
      this.under = new AbortController();
      try {
        await this.run();
      } catch (error) {
        if (error.name !== 'AbortError') this.tell(error.message || 'the server has gone', true);
      }
      this.under = null;
    }
  }

  tell(text, wrong) {
    const status = this.find('status');
    status.textContent = text;
    status.classList.toggle('changed', Boolean(wrong));
  }

  async run() {
    const {changes} = this;
    const all = [...changes.settings, ...changes.swaps, ...changes.faults];
    const label = all.join(', ') || 'the scenario';
    const before = this.now && this.now[1] !== label ? this.now : this.before;
    const ghosts = [this.pinned, before].filter(Boolean).filter(([, text], k, all) => text !== label && all.findIndex((one) => one[1] === text) === k);
    this.remember();
    const answer = await fetch('run', {
      method: 'POST', signal: this.under.signal, headers: {'Content-Type': 'application/json'},
      body: JSON.stringify({
        page: this.page, label, scenario: this.facts.scenario, ...changes,
        earlier: ghosts.map(([key, text]) => [key, `${this.pinned && text === this.pinned[1] ? 'pinned' : 'before'}: ${text}`]),
      }),
    });
    if (answer.status === 409) return; // a later run has been asked for
    if (!answer.ok) throw new Error(await answer.text());
    const {key, html, command, warnings, milliseconds} = await answer.json();
    [this.before, this.now] = [before, [key, label]];
    await this.show(html);
    this.find('command').textContent = command;
    this.form.querySelector('h1').textContent = this.title + (all.length ? ` (changed: ${all.map((one) => one.replace('=', ' = ')).join(', ')})` : '');
    const shown = Math.round(performance.now() - this.began);
    this.form.dataset.shown = shown;
    this.tell(`${warnings.length ? warnings.join(' ') + ' ' : ''}Run in ${milliseconds} ms, shown after ${shown} ms.`);
  }

  async show(html) {
    const place = this.find('place');
    const root = made('div', '', {innerHTML: html}).querySelector('.yv');
    const earlier = place.querySelector('.yv');
    if (earlier) {
      earlier.viewer?.remove();
      place.style.minHeight = `${place.offsetHeight}px`;
    }
    place.replaceChildren(root);
    try { await startViewer(root); } finally { place.style.minHeight = ''; }
  }
}

ready(() => {
  for (const form of document.querySelectorAll('form.bench')) form.bench = new Bench(form);
});
