/* Elements of a page, and when they have been painted. */

export const $ = (id) => document.getElementById(id);

export const make = (tag, text = '', kind = '', properties = {}) => {
  const node = Object.assign(document.createElement(tag), properties);
  if (text) node.textContent = text;
  if (kind) node.className = kind;
  return node;
};

export const button = (text, work, kind = '') => {
  const node = make('button', text, kind, {type: 'button'});
  node.addEventListener('click', work);
  return node;
};

/* A colour of the page's style sheet. */
export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name)
  .trim();

/* Call what draws with these colours when they are others: the system's, or chosen on the page. */
export const whenDark = (work) => {
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', work);
  document.addEventListener('scheme', work);
};

export const afterPaint = (work) => requestAnimationFrame(() => {
  const channel = new MessageChannel();
  channel.port1.onmessage = work;
  channel.port2.postMessage(null);
});

/* A canvas as fine as the screen, to be drawn on in its own pixels. */
export const fineContext = (canvas, width = canvas.clientWidth, height = canvas.clientHeight) => {
  const scale = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [width * scale, height * scale];
  const context = canvas.getContext('2d');
  context.scale(scale, scale);
  return context;
};
