/* Names, numbers and units as they are shown. */

const isKnown = (value) => value !== null && value !== undefined && !Number.isNaN(value);

export const titleOf = (name) => name.replaceAll('_', ' ');

/* As many digits as the uncertainty allows. */
export const digits = (value, std) => {
  if (!isKnown(value)) return '–';
  if (!std) return String(+value.toPrecision(5));
  const places = Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(Math.abs(std)))));
  return value.toFixed(places);
};

export const amount = (value) => {
  if (!isKnown(value)) return '–';
  return value.toFixed(value >= 10 ? 1 : 3);
};

export const signed = (value) => (isKnown(value)
  ? `${value >= 0 ? '+' : '−'}${Math.abs(value).toFixed(3)}` : '–');

/* Evidence, in thousands where it is large. */
export const plain = (value) => {
  if (!isKnown(value)) return '…';
  return (Math.abs(value) < 9999.5 ? value.toFixed(0) : `${(value / 1000).toFixed(0)} k`)
    .replace('-', '−');
};

/* By how much an error fell or rose; nothing below half a percent. */
export const change = (before, now) => {
  const percent = before > 0 ? 100 * (now / before - 1) : 0;
  return Math.abs(percent) < 0.5 ? ''
    : `${percent > 0 ? '+' : '−'}${Math.abs(percent).toFixed(0)} %`;
};

/* The unit of a drive's quantity, or of the efforts of all drives. */
export const unitOf = (state, drive, quantity = 'effort') => state?.units?.[drive]?.[quantity]
  ?? state?.unit ?? '';
