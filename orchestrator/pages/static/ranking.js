// A ranking: a click on a cell of the matrix shows its runs' numbers, and the worst run in the viewer, beside it.

function startRanking() {
  const root = document.querySelector('.ranking');
  if (!root) return;
  const [matrix, chosen, details] = ['.matrix', '.chosen', '.details'].map((name) => root.querySelector(name));
  const cells = [...matrix.querySelectorAll('td.cell a')];
  const idOf = (link) => new URLSearchParams(link.hash.split('?')[1]).get('id');
  const find = (id) => cells.find((cell) => idOf(cell) === id);
  let shown = null;
  const show = async () => {
    const link = find(readAddress('cell')?.get('id')) || (shown ? null : find(root.dataset.first));
    if (!link || link === shown) return;
    const turned = shown !== null;
    for (const one of cells) one.removeAttribute('aria-current');
    link.setAttribute('aria-current', 'true');
    shown = link;
    try {
      const content = await loadSide(root.dataset.folder, idOf(link));
      if (shown !== link) return;
      details.innerHTML = content.html;
      if (content.data) await showSides(chosen, [content]); else clearViewer(chosen);
    } catch (error) {
      details.textContent = `${error.message}: it belongs beside this page.`;
      clearViewer(chosen);
    }
    root.dataset.shown = idOf(link);
    const beside = chosen.getBoundingClientRect().left > matrix.getBoundingClientRect().left + 10;
    if (turned && !beside) chosen.scrollIntoView();
  };
  matrix.addEventListener('keydown', (event) => {
    const step = {ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0]}[event.key];
    const cell = event.target.closest('td');
    if (!step || !cell) return;
    const rows = [...matrix.tBodies[0].rows].map((row) => [...row.querySelectorAll('td.cell a')]);
    const i = rows.findIndex((row) => row.includes(event.target));
    const next = rows[i + step[0]]?.[rows[i].indexOf(event.target) + step[1]];
    if (next) { event.preventDefault(); next.focus(); }
  });
  addEventListener('hashchange', show);
  show();
}

if (document.readyState === 'loading') document.addEventListener('DOMContentLoaded', startRanking);
else startRanking();
