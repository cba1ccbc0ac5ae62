// Looks at the page that it is in, and leaves what it found in the page, as JSON.
(() => {
  const errors = window.findings || [];
  const visible = (e) => e.getClientRects().length > 0;
  const told = (e) => `${e.tagName} ${e.id || e.getAttribute('class') || ''} "${(e.textContent || '').trim().slice(0, 30)}"`;
  const found = { width: innerWidth, scroll: document.documentElement.scrollWidth, errors, broken: [], wide: [], empty: [] };
  Object.assign(found, { small: [], cut: [], links: [], outside: [], plots: 0, tables: 0, hidden: [] });

  for (const a of document.querySelectorAll('a[href]')) {
    const href = a.getAttribute('href');
    if (!href.startsWith('#')) found.links.push(href);
    else if (!document.getElementById(decodeURIComponent(href.slice(1)))) found.broken.push(href);
  }
  // What would be fetched; a link is only followed.
  for (const e of document.querySelectorAll('[src], link[href], image, use, object, iframe, script')) found.outside.push(told(e));
  for (const e of performance.getEntriesByType('resource')) found.outside.push(e.name);

  for (const e of document.body.querySelectorAll('*')) {
    if (!visible(e) || e.closest('svg, .scroll') !== null) continue;
    const box = e.getBoundingClientRect();
    if (box.left < -0.5 || box.right > innerWidth + 0.5) found.wide.push(`${told(e)} ${box.left} to ${box.right}`);
  }
  for (const e of document.querySelectorAll('.scroll')) {
    const box = e.getBoundingClientRect();
    if (box.left < -0.5 || box.right > innerWidth + 0.5) found.wide.push(told(e));
    if (e.scrollWidth > e.clientWidth && !['auto', 'scroll'].includes(getComputedStyle(e).overflowX)) found.wide.push(told(e));
  }
  for (const figure of document.querySelectorAll('figure')) {
    const shown = [...figure.querySelectorAll('svg')].filter(visible);
    if (shown.length !== 1) found.hidden.push(`${shown.length} pictures of ${told(figure)}`);
    for (const svg of shown) {
      found.plots += 1;
      const box = svg.getBoundingClientRect();
      if (box.width < 100 || box.height < 60) found.empty.push(`${told(svg)} ${box.width} x ${box.height}`);
      const scale = box.width / svg.viewBox.baseVal.width;
      for (const text of svg.querySelectorAll('text')) {
        const size = parseFloat(getComputedStyle(text).fontSize) * scale;
        if (size < 12) found.small.push(`${size} px: ${told(text)}`);
        const t = text.getBoundingClientRect();
        if (t.left < box.left - 1 || t.right > box.right + 1 || t.top < box.top - 1 || t.bottom > box.bottom + 1) {
          found.cut.push(`${told(text)} ${t.left}, ${t.top} to ${t.right}, ${t.bottom}`);
        }
      }
    }
  }
  for (const table of document.querySelectorAll('table')) {
    found.tables += 1;
    for (const cell of table.querySelectorAll('th, td')) {
      const size = parseFloat(getComputedStyle(cell).fontSize);
      if (size < 12) found.small.push(`${size} px: ${told(cell)}`);
    }
  }
  for (const text of document.querySelectorAll('p, li, a, figcaption, summary')) {
    const size = parseFloat(getComputedStyle(text).fontSize);
    if (size < 12) found.small.push(`${size} px: ${told(text)}`);
  }
  // A page that is wrong everywhere is told of in a few lines.
  for (const name of ['wide', 'small', 'cut']) found[name] = found[name].slice(0, 8);
  const out = document.createElement('pre');
  out.id = 'findings';
  out.textContent = JSON.stringify(found);
  document.body.append(out);
})();
