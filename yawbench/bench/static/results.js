// The table of runs: a filter by words, sorted by a heading, folders folded. The filter is in the address.

(() => {
  const form = document.querySelector('.results');
  if (!form) return;
  const [filter, found, table] = ['.filter', '.found', 'table'].map((name) => form.querySelector(name));
  const bodies = [...table.tBodies];
  const rowsOf = (body) => [...body.rows].filter((row) => !row.classList.contains('group'));
  const all = bodies.flatMap(rowsOf);
  const plain = (text) => text.toLowerCase().replace(/\s*=\s*/g, '=');
  const texts = new Map(all.map((row) => [row, plain([row.querySelector('input').value, ...[...row.cells].map((cell) => cell.textContent)].join(' '))]));

  // Whether a text has a word; a number is not the beginning of another: 0.3 is not in 0.35.
  const has = (text, word) => {
    for (let at = text.indexOf(word); at >= 0; at = text.indexOf(word, at + 1)) {
      if (!/\d$/.test(word) || !/^\.?\d/.test(text.slice(at + word.length))) return true;
    }
    return false;
  };

  // Show the rows that have all words; a folder stays folded until something is looked for.
  const show = () => {
    const words = plain(filter.value).split(/\s+/).filter(Boolean);
    let count = 0;
    for (const body of bodies) {
      const open = words.length || body.querySelector('.group button')?.getAttribute('aria-expanded') !== 'false';
      let own = 0;
      for (const row of rowsOf(body)) {
        const fits = words.every((word) => has(texts.get(row), word));
        own += fits;
        row.hidden = !fits || !open;
      }
      body.hidden = own === 0;
      count += own;
    }
    found.textContent = `${count} of ${all.length}`;
    const address = filter.value ? `#${encodeURIComponent(filter.value)}` : location.pathname + location.search;
    history.replaceState(null, '', address);
  };

  const value = (row, column) => {
    const cell = row.cells[column];
    return cell.dataset.number === undefined ? cell.textContent.trim() : Number(cell.dataset.number);
  };
  const sort = (heading) => {
    const column = heading.cellIndex;
    const down = heading.getAttribute('aria-sort') === 'ascending';
    for (const one of table.tHead.rows[0].cells) one.removeAttribute('aria-sort');
    heading.setAttribute('aria-sort', down ? 'descending' : 'ascending');
    const compare = (one, other) => {
      const [a, b] = [value(one, column), value(other, column)];
      const numbers = typeof a === 'number' && typeof b === 'number';
      return (down ? -1 : 1) * (numbers ? a - b : String(a).localeCompare(String(b), undefined, {numeric: true}));
    };
    for (const body of bodies) body.append(...rowsOf(body).sort(compare));
  };

  filter.addEventListener('input', show);
  table.addEventListener('click', ({target}) => {
    const button = target.closest('button');
    if (!button) return;
    const heading = button.closest('thead th');
    if (heading) { sort(heading); return; }
    button.setAttribute('aria-expanded', button.getAttribute('aria-expanded') === 'false');
    show();
  });
  filter.value = decodeURIComponent(location.hash.slice(1));
  show();
})();
