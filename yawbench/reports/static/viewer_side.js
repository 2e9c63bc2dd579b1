// Runs of files beside the page: data/<key>.js calls yawbenchSide(key, content) when a script element has loaded it.

const sides = new Map(); // key -> promise of its content
const arriving = new Map(); // key -> resolve

window.yawbenchSide = (key, content) => { arriving.get(key)?.(content); };

function loadSide(folder, key) {
  if (!sides.has(key)) {
    sides.set(key, new Promise((resolve, reject) => {
      arriving.set(key, resolve);
      const script = made('script', '', {src: `${folder}/${key}.js`});
      script.addEventListener('error', () => { sides.delete(key); reject(new Error(`${script.getAttribute('src')} is missing`)); });
      document.head.append(script);
    }));
  }
  return sides.get(key);
}

// The runs of several files as those of one viewer; the first has the views.
function together(parts) {
  if (parts.length === 1) return parts[0];
  const data = {...parts[0], grounds: [], runs: [], signals: {}, metrics: [], marks: [], limits: [], curves: [], why: []};
  const seen = new Set();
  for (const part of parts) {
    const before = data.grounds.length;
    data.grounds.push(...part.grounds);
    Object.assign(data.signals, part.signals);
    for (const [title, values] of part.metrics) {
      let row = data.metrics.find(([other]) => other === title);
      if (!row) data.metrics.push(row = [title, data.runs.map(() => '')]);
      row[1].push(...values);
    }
    const moved = (run) => (run === null ? null : run + data.runs.length);
    for (const kind of ['marks', 'limits', 'curves']) {
      for (const one of part[kind].map((dashed) => [...dashed.slice(0, -1), moved(dashed.at(-1))])) {
        if (!seen.has(JSON.stringify(one))) data[kind].push(one);
        seen.add(JSON.stringify(one));
      }
    }
    data.why.push(...part.why.map(([run, reasons, best]) => [moved(run), reasons.map(([says, time, of]) => [says, time, moved(of)]), moved(best)]));
    data.runs.push(...part.runs.map((run) => ({...run, road: run.road && {...run.road, ground: run.road.ground === null ? null : run.road.ground + before}})));
    for (const row of data.metrics) while (row[1].length < data.runs.length) row[1].push('');
  }
  data.views = data.views.map((view) => ({...view, shown: data.runs.map((_, k) => k)}));
  return data;
}

// Remove the viewer of a holder, and its state from the address.
function clearViewer(holder) {
  const root = holder.querySelector('.yv');
  if (!root) return;
  root.viewer?.remove();
  root.remove();
  writeAddress(root.id, new URLSearchParams());
}

// The viewer without runs that a holder has for its side files.
function frameOf(holder) { return holder.querySelector('template').content.firstElementChild; }

// Show the runs of side files in the viewer that a template holds, in place of the one before, whose panels stay
// unless the address asks for a picture (`asked`). Return the viewer; null if another choice came before it was made.
async function showSides(holder, contents, asked = null) {
  const before = holder.querySelector('.yv');
  const state = asked ? null : before?.viewer?.state ?? before?.inherited;
  clearViewer(holder);
  const root = Object.assign(frameOf(holder).cloneNode(true), {inherited: state});
  if (asked) writeAddress(root.id, asked);
  holder.append(root);
  root.classList.add('yv-started');
  const data = together(contents.map((one) => one.data));
  const viewer = await fillViewer(root, {...data, file: root.id, alone: false}, contents.flatMap((one) => one.blocks.map(inflate)));
  if (viewer && state) {
    const {panels, span, x, difference, tolerance} = state;
    Object.assign(viewer.state, {panels: panels.filter((one) => viewer.known(one)), span, tolerance, difference: difference && data.runs.length > 1});
    if (viewer.axes().includes(x)) viewer.state.x = x;
    if (!viewer.state.panels.length) viewer.state.panels = viewer.initial().panels;
    viewer.lasting = viewer.lasts(); // taken over, not a step of the reader
    viewer.refresh();
  }
  return viewer;
}
