// The events of the shown runs as a list, and why cars were lost: a click goes to the instant.

const MOST_EVENTS = 8; // listed at once; chosen: what a reader looks through

class Events {
  constructor(viewer) {
    const [why, list, rest, count] = ['why', 'events', 'events-rest', 'events-count'].map((name) => viewer.find(name));
    Object.assign(this, {viewer, why, list, rest, count, all: false, key: ''});
    this.lines = viewer.data.why.map((reasons) => [viewer.runs[reasons[0]], this.sentences(reasons)]);
    why.append(...this.lines.map(([, line]) => line));
    this.details = list.closest('details');
    this.details.hidden = !viewer.runs.some((run) => run.events.length);
    this.details.addEventListener('toggle', () => { this.key = ''; this.fill(); });
    rest.addEventListener('click', () => { this.all = true; this.key = ''; this.fill(); });
    viewer.subscribe(() => this.fill());
  }

  // A line on a run that was lost: its sentences, each with its instant, and the run beside it that did best.
  sentences([number, reasons, best]) {
    const {viewer} = this;
    const line = made('li', made('b', `${viewer.runs[number].label}: `));
    reasons.forEach(([says, time, of], k) => {
      if (k) line.append('; ');
      line.append(time === null ? says : this.link(says, time, of ?? number));
    });
    line.append('.');
    if (best !== null && best !== number) {
      const beside = made('button', `beside ${viewer.runs[best].label}`, {type: 'button'});
      beside.addEventListener('click', () => viewer.showRuns([number, best], number));
      line.append(' ', beside);
    }
    return line;
  }

  link(words, time, number) {
    const link = made('a', words, {href: '#', role: 'button'});
    link.addEventListener('click', (event) => {
      event.preventDefault();
      this.viewer.goTo(time, number);
    });
    return link;
  }

  // List the events of the shown runs, and why these were lost, if they have changed.
  fill() {
    const {viewer} = this;
    const key = JSON.stringify([viewer.state.shown, viewer.state.offsets, viewer.theme.ink]);
    if (key === this.key) return;
    this.key = key;
    for (const [run, line] of this.lines) line.hidden = !viewer.shows(run);
    this.why.hidden = this.lines.every(([, line]) => line.hidden);
    const found = viewer.runs.filter((run) => viewer.shows(run)).flatMap((run) => run.events.map((event) => ({run, ...event})))
      .sort((one, other) => one.time - other.time);
    this.count.textContent = found.length;
    const most = this.all ? Infinity : MOST_EVENTS;
    this.rest.hidden = found.length <= most;
    this.rest.textContent = `All ${found.length} events`;
    if (!this.details.open) return;
    this.list.replaceChildren(...found.slice(0, most).map(({run, time, label, far, until}) => {
      const row = made('tr');
      const at = made('button', `${time.toFixed(3)} s`, {type: 'button'});
      at.addEventListener('click', () => viewer.goTo(time, run.number));
      const said = made('td', '', {innerHTML: viewer.runs.length > 1 ? viewer.swatch(run) : '', title: run.label});
      said.append(` ${label}${until === null ? '' : `, until ${until.toFixed(2)} s`}${far ? `: ${far}` : ''}`);
      row.append(made('td', at), said);
      return row;
    }));
  }
}
