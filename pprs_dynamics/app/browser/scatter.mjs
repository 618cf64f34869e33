/* Anything over anything: a scatter in which a region can be marked. */

import {css, fineContext, whenDark} from './dom.mjs';

const UNITS = {time: 's', rod_angle: 'rad', platform_x: 'm', platform_y: 'm', platform_z: 'm',
               platform_tilt: 'rad', platform_turn: 'rad', direction: ''};
/* A variable with its unit, which may be that of a drive. */
export const titled = (name, drive, unitOf) => {
  const unit = UNITS[name] ?? unitOf(drive, ['position', 'velocity', 'acceleration'].includes(name)
    ? name : 'effort');
  return `${name.replaceAll('_', ' ')}${unit ? ` [${unit}]` : ''}`;
};

/* Round numbers for an axis. */
export const ticksOf = (low, high, most) => {
  const raw = (high - low) / most || 1;
  const size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * size).find((s) => s >= raw);
  const found = [];
  for (let t = Math.ceil(low / step) * step; t <= high + 1e-9 * step; t += step) found.push(t);
  return found;
};

export class Scatter {
  /* `marked` is called with {x_range, y_range}, `unitOf` with a drive and a quantity. */
  constructor(canvas, marked, unitOf) {
    this.canvas = canvas;
    this.marked = marked;
    this.unitOf = unitOf;
    this.x = this.y = new Float32Array(0);
    this.names = ['', ''];
    this.region = null;
    new ResizeObserver(() => this.draw()).observe(canvas);
    whenDark(() => this.draw());
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.start = [event.offsetX, event.offsetY];
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!this.start) return;
      this.region = [this.start, [event.offsetX, event.offsetY]].map((p) => this.value(p));
      this.draw();
    });
    canvas.addEventListener('pointerup', () => {
      this.start = null;
      if (this.region) this.report();
    });
  }

  use(names, x, y, drive) {
    this.names = names;
    this.drive = drive;
    [this.x, this.y] = [x, y];
    this.region = null;
    this.limits = [x, y].map((values) => {
      let [low, high] = [Infinity, -Infinity];
      for (const v of values) {
        if (v < low) low = v;
        if (v > high) high = v;
      }
      const margin = 0.03 * (high - low) || 1;
      return [low - margin, high + margin];
    });
    this.canvas.setAttribute('aria-label', `${names[1]} over ${names[0]}, ${x.length} samples`);
    this.draw();
  }

  report() {
    const [[x0, y0], [x1, y1]] = this.region;
    if (x0 !== x1 && y0 !== y1) {
      this.marked({x_range: [Math.min(x0, x1), Math.max(x0, x1)],
                   y_range: [Math.min(y0, y1), Math.max(y0, y1)]});
    }
  }

  get box() {
    return {left: 66, top: 8, right: this.canvas.clientWidth - 10,
            bottom: this.canvas.clientHeight - 38};
  }

  value([px, py]) {
    const {left, top, right, bottom} = this.box;
    const [[x0, x1], [y0, y1]] = this.limits;
    return [x0 + (x1 - x0) * (px - left) / (right - left),
            y1 - (y1 - y0) * (py - top) / (bottom - top)];
  }

  draw() {
    const {canvas} = this;
    if (!this.limits || !canvas.clientWidth) return;
    const context = fineContext(canvas);
    const {left, top, right, bottom} = this.box;
    const [[x0, x1], [y0, y1]] = this.limits;
    const px = (x) => left + (right - left) * (x - x0) / (x1 - x0);
    const py = (y) => bottom - (bottom - top) * (y - y0) / (y1 - y0);
    context.font = '12px system-ui';
    context.strokeStyle = css('--line');
    context.fillStyle = css('--quiet');
    context.textAlign = 'center';
    for (const t of ticksOf(x0, x1, 8)) {
      context.beginPath();
      context.moveTo(px(t), top);
      context.lineTo(px(t), bottom);
      context.stroke();
      context.fillText(String(+t.toPrecision(4)), px(t), bottom + 15);
    }
    context.textAlign = 'right';
    for (const t of ticksOf(y0, y1, 7)) {
      context.beginPath();
      context.moveTo(left, py(t));
      context.lineTo(right, py(t));
      context.stroke();
      context.fillText(String(+t.toPrecision(4)), left - 5, py(t) + 4);
    }
    context.textAlign = 'center';
    context.fillText(titled(this.names[0], this.drive, this.unitOf), (left + right) / 2, bottom + 32);
    context.save();
    context.translate(12, (top + bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.fillText(titled(this.names[1], this.drive, this.unitOf), 0, 0);
    context.restore();
    context.fillStyle = css('--now');
    context.globalAlpha = Math.max(0.12, Math.min(0.8, 1500 / this.x.length));
    for (let k = 0; k < this.x.length; k++) {
      if (this.y[k] === this.y[k]) context.fillRect(px(this.x[k]) - 1, py(this.y[k]) - 1, 2, 2);
    }
    context.globalAlpha = 1;
    if (this.region) {
      const [[a, b], [c, d]] = this.region;
      context.fillStyle = css('--mark');
      context.fillRect(px(a), py(b), px(c) - px(a), py(d) - py(b));
      context.strokeStyle = css('--chosen');
      context.strokeRect(px(a), py(b), px(c) - px(a), py(d) - py(b));
    }
  }
}
