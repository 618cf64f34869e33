/* The error of every drive: before, now, and the noise. */

import {css, fineContext, make} from './dom.mjs';
import {amount, change, unitOf} from './format.mjs';

const HEIGHT = 22; // [px]

const tile = (name) => {
  const box = make('div', '', 'error');
  box.dataset.drive = name;
  const line = make('div', '', 'name');
  line.append(make('span'), make('span', '', 'fall'));
  box.append(line, make('canvas'), make('div', '', 'figures'));
  return box;
};

const bars = (canvas, {before, now, noise}, most) => {
  const width = canvas.clientWidth || 140;
  const context = fineContext(canvas, width, HEIGHT);
  const place = (value) => width * value / most;
  context.fillStyle = css('--before');
  context.fillRect(0, 3, place(before), 7);
  context.fillStyle = css('--now');
  context.fillRect(0, 12, place(now), 7);
  if (noise !== null) {
    context.fillStyle = css('--noise');
    context.fillRect(Math.min(place(noise), width - 2), 0, 2, HEIGHT);
  }
};

export const showErrors = (root, state) => {
  const entries = Object.entries(state.errors);
  const most = Math.max(...entries.map(([, drive]) => Math.max(drive.before, drive.now)), 1e-9);
  if (root.children.length !== entries.length) {
    root.replaceChildren(...entries.map(([name]) => tile(name)));
  }
  entries.forEach(([name, drive], k) => {
    const [, canvas, figures] = root.children[k].children;
    const [before, now, noise] = [drive.before, drive.now, drive.noise].map(amount);
    const unit = unitOf(state, name);
    root.children[k].querySelector('.fall').textContent = change(drive.before, drive.now);
    root.children[k].querySelector('.name span').textContent = unit ? `${name} [${unit}]` : name;
    figures.replaceChildren(`${before} → `, make('span', now, 'now'),
                            drive.noise === null ? '' : ` → noise ${noise}`);
    bars(canvas, drive, most);
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label',
                        `${name}: ${before} before, ${now} now, noise ${noise} ${unit}`);
  });
};
