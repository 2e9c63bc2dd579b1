'use strict';
// What the templates compress (`compressed` of `page_parts.py`) is in attributes `data-packed`.

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function unpacked(element) {
  const text = new TextDecoder().decode(await inflate(element.dataset.packed));
  element.removeAttribute('data-packed');
  return text;
}

// A folded part waits in a template, which the browser neither lays out nor styles, until it is opened.
let opened = [];
const unfold = (details) => details.querySelectorAll(':scope > template:not([data-packed])').forEach((folded) => folded.replaceWith(folded.content));
addEventListener('toggle', ({target}) => { if (target.open) unfold(target); }, true);
// The browser finds what is unfolded, and opens what it finds: before it looks, everything is.
addEventListener('keydown', ({key, ctrlKey, metaKey}) => {
  if (key === 'F3' || key === '/' || ((ctrlKey || metaKey) && key.toLowerCase() === 'f')) document.querySelectorAll('details').forEach(unfold);
});
addEventListener('beforeprint', () => { opened = [...document.querySelectorAll('details:not([open])')]; opened.forEach((details) => { unfold(details); details.open = true; }); });
addEventListener('afterprint', () => { opened.forEach((details) => { details.open = false; }); });

// Fill folded parts and images, and last run the scripts that use them; these unpack their data.
(async () => {
  const scripts = await Promise.all([...document.querySelectorAll('[data-packed]:not([type])')].map(async (place) => {
    const text = await unpacked(place);
    if (place.tagName === 'SCRIPT') return [place, text];
    if (place.tagName === 'TEMPLATE') place.innerHTML = text; else place.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
    if (place.parentElement.open) unfold(place.parentElement);
    return null;
  }));
  for (const [place, text] of scripts.filter(Boolean)) place.replaceWith(Object.assign(document.createElement('script'), {textContent: text}));
})();
