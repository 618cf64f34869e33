/* What the curves show, as files: SVG for slides and papers, CSV for anything else. */

const WIDTH = 960, PANEL = 150, GAP = 14, LEFT = 96, RIGHT = 18, TOP = 40, BOTTOM = 58; // [px]
const WHITE = '#ffffff', INK = '#1a1c20', LINE = '#d8dbe0'; // on white, whatever the page is
const COLOURS = {before: '#8a9099', now: '#0072b2'}; // as the light page
const TITLE = 17, TICK = 14; // [px]: read from the back of a room
const FINE = 2; // columns per pixel, of each of which the lowest and the highest sample are drawn

/* Samples [from, to) of rising times that lie in a range. */
export const within = (time, [a, b]) => {
  let from = 0, to = time.length;
  while (from < to && time[from] < a) from++;
  while (to > from && time[to - 1] > b) to--;
  return [from, to];
};

/* Round numbers from a to b, about `count` of them. */
export const ticks = (a, b, count) => {
  const raw = (b - a) / count, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * size).find((each) => each >= raw);
  const found = [];
  for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; k++) {
    found.push(+(k * step).toPrecision(12));
  }
  return found;
};

/* The columns of what is seen, a row per sample; gaps are empty. */
export const csvOf = (seen, range) => {
  const [from, to] = within(seen[0].time, range);
  const head = ['time [s]', ...seen.flatMap(({drive, unit}) => [
    `${drive} error before [${unit}]`, `${drive} error now [${unit}]`])];
  const rows = [head.join(',')];
  for (let k = from; k < to; k++) {
    rows.push([seen[0].time[k], ...seen.flatMap(({before, now}) => [before[k], now[k]])]
      .map((value) => (value === null || Number.isNaN(value) ? '' : +value.toPrecision(9)))
      .join(','));
  }
  return `${rows.join('\n')}\n`;
};

/* Points of a line, all peaks among them, in columns finer than a pixel; gaps begin anew. */
const path = (time, values, [from, to], x, y) => {
  const points = [];
  let column = null, isOn = false, low = null, high = null;
  const flush = () => {
    if (low === null) return;
    for (const k of low === high ? [low] : [Math.min(low, high), Math.max(low, high)]) {
      points.push(`${isOn ? 'L' : 'M'}${x(time[k]).toFixed(1)} ${y(values[k]).toFixed(1)}`);
      isOn = true;
    }
    low = high = null;
  };
  for (let k = from; k < to; k++) {
    const now = Math.floor(FINE * x(time[k]));
    if (values[k] === null || now !== column) flush();
    column = now;
    if (values[k] === null) {
      isOn = false;
      continue;
    }
    if (low === null || values[k] < values[low]) low = k;
    if (high === null || values[k] > values[high]) high = k;
  }
  flush();
  return points.join('');
};

const text = (x, y, label, more = '') => `<text x="${x}" y="${y}" ${more}>${
  label.replace(/&/g, '&amp;').replace(/</g, '&lt;')}</text>`;

/* What is seen as a drawing with titled axes, a panel per drive. */
export const svgOf = (seen, range) => {
  const [a, b] = range, right = WIDTH - RIGHT;
  const height = TOP + seen.length * (PANEL + GAP) - GAP + BOTTOM;
  const x = (t) => LEFT + ((t - a) / (b - a)) * (right - LEFT);
  const parts = [`<rect width="${WIDTH}" height="${height}" fill="${WHITE}"/>`];
  Object.entries(COLOURS).forEach(([name, colour], k) => {
    const at = LEFT + 110 * k;
    parts.push(`<path d="M${at} ${TOP - 18}h26" stroke="${colour}" stroke-width="3"/>`,
      text(at + 33, TOP - 13, name, `font-size="${TITLE}"`));
  });
  seen.forEach(({drive, unit, time, before, now}, d) => {
    const top = TOP + d * (PANEL + GAP), base = top + PANEL, part = within(time, range);
    let low = Infinity, high = -Infinity;
    for (const row of [before, now]) {
      for (let k = part[0]; k < part[1]; k++) {
        if (row[k] === null) continue;
        low = Math.min(low, row[k]);
        high = Math.max(high, row[k]);
      }
    }
    if (!(high > low)) [low, high] = [(low || 0) - 1, (low || 0) + 1];
    if (!Number.isFinite(low + high)) [low, high] = [-1, 1];
    const y = (value) => base - 6 - ((value - low) / (high - low)) * (PANEL - 12);
    for (const t of ticks(a, b, 8)) {
      parts.push(`<path d="M${x(t).toFixed(1)} ${top}V${base}" stroke="${LINE}"/>`);
    }
    for (const value of ticks(low, high, 4)) {
      parts.push(`<path d="M${LEFT} ${y(value).toFixed(1)}H${right}" stroke="${LINE}"/>`,
        text(LEFT - 8, (y(value) + 5).toFixed(1), `${value}`,
          `font-size="${TICK}" text-anchor="end"`));
    }
    for (const [name, row] of Object.entries({before, now})) {
      parts.push(`<path d="${path(time, row, part, x, y)}" fill="none" stroke="${
        COLOURS[name]}" stroke-width="1.3" stroke-linejoin="round"/>`);
    }
    parts.push(`<path d="M${LEFT} ${top}V${base}H${right}" fill="none" stroke="${INK}"/>`,
      text(0, 0, `${drive} [${unit}]`, `font-size="${TITLE}" text-anchor="middle" `
        + `transform="translate(24 ${top + PANEL / 2}) rotate(-90)"`));
  });
  const base = height - BOTTOM;
  for (const t of ticks(a, b, 8)) {
    parts.push(text(x(t).toFixed(1), base + 20, `${t}`,
      `font-size="${TICK}" text-anchor="middle"`));
  }
  parts.push(text((LEFT + right) / 2, base + 46, 'time [s]',
    `font-size="${TITLE}" text-anchor="middle"`));
  parts.push(text(right, TOP - 13, 'error: measured less model',
    `font-size="${TITLE}" text-anchor="end"`));
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${height}" width="${
    WIDTH}" height="${height}" font-family="Helvetica, Arial, sans-serif" fill="${INK}">${
    parts.join('\n')}</svg>\n`;
};

/* Let the browser save a text or a blob. */
export const save = (name, kind, content) => {
  const link = Object.assign(document.createElement('a'),
    {href: URL.createObjectURL(new Blob([content], {type: kind})), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
