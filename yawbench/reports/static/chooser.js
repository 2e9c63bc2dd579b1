// Links on one side, #KIND?id=KEY, and on the other what the side file KEY has: text, and runs in the viewer.

function startChooser() {
  const root = document.querySelector('.choosing');
  if (!root) return;
  const [chosen, details] = ['.chosen', '.details'].map((name) => root.querySelector(name));
  const idOf = (hash) => hash.slice(1).split('&&').map((part) => new URLSearchParams(part.split('?')[1]).get('id')).find(Boolean);
  const links = () => [...root.querySelectorAll('a[href^="#"]')];
  let shown = null;
  const show = async () => {
    const asked = links().filter((link) => idOf(link.hash) === idOf(location.hash));
    const key = asked.length ? idOf(location.hash) : (shown || root.dataset.first);
    const current = asked.find((link) => link.hash === location.hash) || asked[0] || links().find((link) => idOf(link.hash) === key);
    for (const link of links()) {
      if (link.hash === current?.hash) link.setAttribute('aria-current', 'true'); else link.removeAttribute('aria-current');
    }
    const turned = shown !== null;
    const folded = [...root.querySelectorAll('section > details')];
    const told = key !== shown && folded.find((one) => one.parentElement.id === key); // a study's claims
    if (told) {
      for (const one of folded) one.open = one === told;
      if (turned) told.parentElement.scrollIntoView({block: 'nearest'});
    }
    if (key && key !== shown) {
      shown = key;
      const picture = readAddress(frameOf(chosen).id); // before the viewer that is still there writes its own
      try {
        const content = await loadSide(root.dataset.folder, key);
        if (shown !== key) return;
        details.innerHTML = content.html;
        if (content.data) await showSides(chosen, [content], picture); else clearViewer(chosen);
      } catch (error) {
        if (shown !== key) return;
        details.textContent = `${error.message}: it belongs beside this page.`;
        clearViewer(chosen);
      }
      root.dataset.shown = key;
    }
    const beside = chosen.getBoundingClientRect().left > root.firstElementChild.getBoundingClientRect().left + 10;
    if (turned && asked.length) chosen.scrollIntoView({block: beside ? 'nearest' : 'start'});
  };
  addEventListener('hashchange', show);
  show();
}

ready(startChooser);
