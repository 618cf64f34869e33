/* What is seen, in the address: a link shows the same view, window and mark to whoever opens it.

Ticks, values and recordings are the session's, which all browsers share. */

const numbers = (text) => {
  const found = (text ?? '').split('~').map(Number);
  return found.length === 2 && found.every(Number.isFinite) && found[1] > found[0] ? found : null;
};

/* {view, window: [from, to] or null, mark: {time, drive} or null, axes: {x, y, drive}}. */
export const written = ({view, window, mark, axes}) => {
  const query = new URLSearchParams({view});
  if (window) query.set('window', window.map((t) => +t.toFixed(3)).join('~'));
  if (mark?.time) {
    query.set('mark', mark.time.map((t) => +t.toFixed(3)).join('~'));
    if (mark.drive) query.set('on', mark.drive);
  }
  for (const [key, value] of Object.entries(axes ?? {})) if (value) query.set(key, value);
  return `#${query}`;
};

/* Return the settings in an address, which somebody may have typed; invalid ones are left out. */
export const read = (hash, views) => {
  const query = new URLSearchParams(hash.replace(/^#/, ''));
  const time = numbers(query.get('mark'));
  const view = query.get('view');
  return {view: views.includes(view) ? view : null, window: numbers(query.get('window')),
          mark: time && {time, drive: query.get('on')},
          axes: Object.fromEntries(['x', 'y', 'drive'].flatMap(
            (key) => (query.get(key) ? [[key, query.get(key)]] : [])))};
};
