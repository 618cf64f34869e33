// Draws figures when they come into view, links their time axes, cursor and menus.
'use strict';
(() => {
  const dark = matchMedia('(prefers-color-scheme: dark)');
  // Lines that are dark on white, as they are drawn on black.
  const ON_BLACK = {
    '#666666': '#a9aeb5', '#1a1a1a': '#f2f2f2', '#0072B2': '#4C97FF', '#009E73': '#2fcf9f',
    '#D55E00': '#ff8a3d', '#bbbbbb': '#6d737b', '#000000': '#ffffff', '#999999': '#c0c4c9',
  };
  const plots = [...document.querySelectorAll('.plot')];
  const menus = [...document.querySelectorAll('select[data-menu]')];
  const drawn = new Set();
  let span = null;
  let library = null;

  // The library is unpacked when a figure is first drawn.
  async function unpack() {
    const letters = document.getElementById('plotly').textContent;
    const packed = await fetch(`data:application/octet-stream;base64,${letters}`);
    const unpacked = packed.body.pipeThrough(new DecompressionStream('gzip'));
    const script = document.createElement('script');
    script.textContent = await new Response(unpacked).text();
    document.head.append(script);
  }

  async function plotly() {
    library ??= unpack();
    await library;
    return window.Plotly;
  }

  function contentOf(plot) {
    const content = themed(document.getElementById(`${plot.id}-data`).textContent);
    if (span && plot.dataset.time !== undefined) content.layout.xaxis.range = span;
    show(content.data);
    return content;
  }

  // What Plotly draws of a figure in JSON, in the colours of the page.
  function themed(text) {
    if (dark.matches) {
      for (const [from, to] of Object.entries(ON_BLACK)) text = text.replaceAll(from, to);
    }
    const {data, layout} = JSON.parse(text);
    const ink = dark.matches ? '#ececec' : '#1a1a1a';
    const grid = dark.matches ? '#3d4248' : '#e2e2e2';
    const paper = dark.matches ? '#16181b' : '#ffffff';
    const axis = {gridcolor: grid, zerolinecolor: grid, linecolor: grid};
    layout.xaxis ??= {};
    layout.yaxis ??= {};
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis/.test(key)) layout[key] = {...axis, ...layout[key]};
    }
    Object.assign(layout, {paper_bgcolor: paper, plot_bgcolor: paper});
    layout.font = {size: 13, color: ink, family: 'system-ui, sans-serif', ...layout.font};
    layout.hoverlabel = {font: {size: 13}, ...layout.hoverlabel};
    return {data, layout};
  }

  // Traces of a drive are shown where the menus stand on it.
  function show(data) {
    const drive = menus[0]?.value;
    const shown = data.map((trace) => !trace.meta?.drive || trace.meta.drive === drive);
    data.forEach((trace, k) => { if (trace.meta?.drive) trace.visible = shown[k]; });
    return shown;
  }

  async function draw(plot) {
    if (drawn.has(plot)) return;
    drawn.add(plot);
    const Plotly = await plotly();
    const {data, layout} = contentOf(plot);
    await Plotly.newPlot(plot, data, layout, {displayModeBar: false, responsive: true});
    if (plot.dataset.time !== undefined) link(Plotly, plot);
    plot.dataset.drawn = Math.round(performance.now());
  }

  function link(Plotly, plot) {
    const cursor = document.createElement('div');
    cursor.className = 'cursor';
    cursor.hidden = true;
    plot.append(cursor);
    const others = () => plots.filter((other) => other !== plot && other.dataset.time !== undefined
                                      && other.dataset.drawn !== undefined);
    plot.on('plotly_relayout', (change) => {
      const key = Object.keys(change).find((name) => /^xaxis\d*\.(range(\[0\])?|autorange)$/.test(name));
      if (!key) return;
      const now = key.endsWith('autorange') ? null : [...plot.layout.xaxis.range];
      if (String(now) === String(span)) return;
      span = now;
      for (const other of others()) {
        Plotly.relayout(other, now ? {'xaxis.range': now} : {'xaxis.autorange': true});
      }
    });
    plot.on('plotly_hover', ({points}) => {
      for (const other of [plot, ...others()]) {
        const axis = other._fullLayout.xaxis;
        const line = other.querySelector('.cursor');
        line.style.left = `${axis._offset + axis.d2p(points[0].x)}px`;
        line.hidden = other === plot;
      }
    });
    plot.on('plotly_unhover', () => {
      document.querySelectorAll('.cursor').forEach((line) => { line.hidden = true; });
    });
  }

  for (const menu of menus) {
    menu.addEventListener('change', async () => {
      menus.forEach((other) => { other.value = menu.value; });
      const Plotly = await plotly();
      for (const plot of plots) {
        if (plot.dataset.drawn !== undefined && plot.data.some((trace) => trace.meta?.drive)) {
          Plotly.restyle(plot, {visible: show(plot.data)});
        }
      }
    });
  }

  dark.addEventListener('change', async () => {
    const Plotly = await plotly();
    for (const plot of plots.filter((drawn) => drawn.dataset.drawn !== undefined)) {
      const {data, layout} = contentOf(plot);
      Plotly.react(plot, data, layout);
    }
  });

  for (const button of document.querySelectorAll('.command button')) {
    button.addEventListener('click', async () => {
      const code = button.previousElementSibling;
      try {
        await navigator.clipboard.writeText(code.textContent);
      } catch {
        getSelection().selectAllChildren(code);
        document.execCommand('copy');
      }
      button.textContent = 'Copied';
    });
  }

  const seen = new IntersectionObserver((entries) => {
    entries.filter((entry) => entry.isIntersecting).forEach((entry) => {
      seen.unobserve(entry.target);
      // The text is painted first.
      requestAnimationFrame(() => setTimeout(() => draw(entry.target)));
    });
  }, {rootMargin: '200px'});
  plots.forEach((plot) => seen.observe(plot));
  addEventListener('beforeprint', () => plots.forEach(draw));
})();
