// Arrow keys go from cell to cell of the matrix.

ready(() => document.querySelector('.matrix').addEventListener('keydown', (event) => {
  const step = {ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0]}[event.key];
  if (!step || !event.target.closest('td')) return;
  const rows = [...event.currentTarget.tBodies[0].rows].map((row) => [...row.querySelectorAll('td.cell a')]);
  const i = rows.findIndex((row) => row.includes(event.target));
  const next = rows[i + step[0]]?.[rows[i].indexOf(event.target) + step[1]];
  if (next) { event.preventDefault(); next.focus(); }
}));
