// Fill what `packed` of `page_parts.py` emptied: folded parts, images, data, and last the scripts that use them.
(async () => {
  const places = [...document.querySelectorAll('[data-packed]')];
  const block = document.getElementById('packed');
  const bytes = Uint8Array.from(atob(block.textContent), (one) => one.charCodeAt(0));
  block.remove();
  const texts = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).json();
  places.forEach((place, k) => {
    if (place.tagName === 'TEMPLATE') place.innerHTML = texts[k];
    else if (place.tagName === 'IMG') place.src = texts[k];
    else if (place.type) place.textContent = texts[k];
    place.removeAttribute('data-packed');
    if (place.parentElement.open) unfold(place.parentElement);
  });
  places.forEach((place, k) => {
    if (place.tagName === 'SCRIPT' && !place.type) place.replaceWith(Object.assign(document.createElement('script'), {textContent: texts[k]}));
  });
})();
