// One signal over the whole time above the slider, with a line at the moment shown.

const THUMB = 8; // half the width of the slider's thumb: its ends lie so far inside

function drawStrip(canvas, density, runs, states, channel, readout, from, to, t) {
  const {context: c, width, height} = surface(canvas, density);
  if (!width || !height) return;
  const drawn = runs.filter((run) => channel in run.channels);
  const [low, high] = drawn.reduce((range, run) => extremes(run.channels[channel], range), [0, 0]);
  const span = high - low || 1;
  const across = (time) => THUMB + ((time - from) / (to - from || 1)) * (width - 2 * THUMB);
  const up = (value) => height - 6 - ((value - low) / span) * (height - 26);
  c.beginPath();
  c.moveTo(THUMB, up(0));
  c.lineTo(width - THUMB, up(0));
  stroke(c, '#ccc', 1, 1);
  for (const run of drawn) {
    const values = run.channels[channel];
    const [times, heights] = [run.channels.time.map(across), values.map(up)];
    for (let first = 0, i = 1; i <= values.length; i++) {
      const step = i < values.length ? values[i] - values[i - 1] : NaN; // NaN: where there is no value, too
      if (!Number.isNaN(step) && !turns(channel, step)) continue;
      polyline(c, times, heights, first, i - 1);
      stroke(c, run.colour, 1.6, 1, run.dash);
      first = i;
    }
  }
  c.beginPath();
  c.moveTo(across(t), 16);
  c.lineTo(across(t), height);
  stroke(c, INK, 1, 1);
  const range = [low, high].map((value) => decimal(value * readout.factor, readout.decimals)).join(' to ');
  text(c, `${readout.label}, ${range} ${readout.unit}`, THUMB, 8, {size: 12});
}

function timeUnder(canvas, event, from, to) {
  const box = canvas.getBoundingClientRect();
  const part = (event.clientX - box.left - THUMB) / (box.width - 2 * THUMB);
  return from + Math.min(Math.max(part, 0), 1) * (to - from);
}
