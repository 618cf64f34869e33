/* What explains a marked error: the shares of effects that are not ticked. */

import {$, button, css, make} from './dom.mjs';
import {amount, titleOf} from './format.mjs';

const LEAST = 0.005; // of the squared error, that is listed
const MOST = 8;

const bar = ({explained, net}) => {
  const canvas = make('canvas', '', '', {width: 200, height: 8});
  const context = canvas.getContext('2d');
  for (const [colour, share] of [['--line', 1], ['--before', explained], ['--now', net]]) {
    context.fillStyle = css(colour);
    context.fillRect(0, 0, 200 * Math.max(share, 0), 8);
  }
  return canvas;
};

export const placeOf = (asked) => (asked.time
  ? `${asked.time.map((t) => t.toFixed(2)).join(' to ')} s on ${asked.drive || 'all drives'}`
  : `a region of ${asked.drive}`);

/* `tick` is called with an effect and when; `see` with the spans in which a region's samples lie. */
export const showShares = (asked, found, tick, see, unit = '') => {
  $('spans').replaceChildren();
  if (!asked) {
    $('shares-of').textContent = 'Drag over a curve or a scatter plot: each effect is listed with '
      + 'the share of the error there that it explains.';
    $('share-list').replaceChildren();
    return;
  }
  $('shares-of').textContent = `${found.samples} samples in ${placeOf(asked)}: error ${
    amount(found.before)} → ${amount(found.now)} ${unit}. Share of the squared error now, less the
 penalty of each effect:`;
  const items = found.shares.filter((share) => share.net > LEAST).slice(0, MOST).map((share) => {
    const item = make('li');
    const place = button('', (event) => tick(share.effect, event.timeStamp));
    place.title = `explains ${(100 * share.explained).toFixed(1)} % there; tick it`;
    place.append(make('span', `${titleOf(share.effect)}${share.drives ? ` on ${
      share.drives.join(', ')}` : ''}`), make('b', `${(100 * share.net).toFixed(0)} %`), bar(share));
    item.append(place);
    return item;
  });
  $('share-list').replaceChildren(...(items.length ? items
    : [make('li', 'No effect explains it beyond its penalty.')]));
  if (!asked.time && found.spans.length) {
    $('spans').append(button(`Show when: ${found.spans.length} span${
      found.spans.length > 1 ? 's' : ''}, the longest at ${found.spans[0][0].toFixed(2)} s`,
    () => see(found.spans)));
  }
};
