/* The robot in three dimensions, moving, its drives coloured by their error. */

import {css, fineContext, whenDark} from './dom.mjs';

/* Blue is little, red is much: colour-blind eyes distinguish them, and on both backgrounds. */
const HEAT = [[33, 102, 172], [103, 169, 207], [209, 190, 160], [239, 138, 98], [178, 24, 43]];
export const heat = (share) => {
  const at = Math.max(0, Math.min(share, 1)) * (HEAT.length - 1);
  const k = Math.min(Math.floor(at), HEAT.length - 2);
  const mix = HEAT[k].map((c, n) => Math.round(c + (HEAT[k + 1][n] - c) * (at - k)));
  return `rgb(${mix.join(',')})`;
};

export class Robot {
  constructor(canvas, moved) {
    this.canvas = canvas;
    this.moved = moved; // called with the frame
    this.frame = 0;
    this.turn = -0.7;
    this.tilt = 0.35;
    this.what = 'now';
    new ResizeObserver(() => this.draw()).observe(canvas);
    whenDark(() => this.draw());
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.held = [event.offsetX, event.offsetY];
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!this.held) return;
      this.rotate(0.01 * (event.offsetX - this.held[0]), 0.01 * (event.offsetY - this.held[1]));
      this.held = [event.offsetX, event.offsetY];
    });
    canvas.addEventListener('pointerup', () => { this.held = null; });
    canvas.addEventListener('keydown', (event) => {
      const step = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1],
                    ArrowDown: [0, 0.1]}[event.key];
      if (step) {
        event.preventDefault();
        this.rotate(...step);
      }
    });
  }

  /* `header`: points that lines join, and their drives; see Skeleton. */
  use(header, arrays) {
    const {lines, face, joints, labels} = header;
    const [time, points, before, now] = ['time', 'points', 'before', 'now'].map(
      (name) => arrays[name].values);
    Object.assign(this, {lines, face, joints, labels, time, points, before, now});
    this.count = points.length / (3 * time.length);
    this.drives = before.length / time.length;
    // The 95th percentile: a single peak would make all else blue.
    const sorted = Float32Array.from(before).sort();
    this.most = sorted[Math.floor(0.95 * (sorted.length - 1))] || 1;
    this.frame = Math.min(this.frame, time.length - 1);
    const bounds = [0, 1, 2].map(() => [Infinity, -Infinity]);
    points.forEach((v, k) => {
      const bound = bounds[k % 3];
      bound[0] = Math.min(bound[0], v);
      bound[1] = Math.max(bound[1], v);
    });
    bounds[2][0] = Math.min(bounds[2][0], 0);
    this.centre = bounds.map(([a, b]) => (a + b) / 2);
    this.size = Math.max(...bounds.map(([a, b]) => b - a)) || 1;
    this.draw();
  }

  rotate(turn, tilt) {
    this.turn += turn;
    this.tilt = Math.max(-0.2, Math.min(1.5, this.tilt + tilt));
    this.draw();
  }

  /* Go to the frame nearest to a time [s]. */
  goTo(time) {
    let nearest = 0;
    this.time?.forEach((t, k) => {
      if (Math.abs(t - time) < Math.abs(this.time[nearest] - time)) nearest = k;
    });
    if (this.time) this.go(nearest);
  }

  go(frame) {
    this.frame = frame;
    this.draw();
    this.moved(frame);
  }

  play() {
    this.playing = true;
    const began = performance.now();
    const first = this.time[this.frame];
    const step = () => {
      if (!this.playing) return;
      const now = first + (performance.now() - began) / 1000;
      let frame = this.frame;
      while (frame < this.time.length - 1 && this.time[frame] < now) frame += 1;
      this.go(frame);
      if (frame === this.time.length - 1) this.playing = false;
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
  }

  point(which) {
    const at = 3 * (this.frame * this.count + which);
    return [this.points[at], this.points[at + 1], this.points[at + 2]];
  }

  draw() {
    const {canvas} = this;
    if (!this.time || !canvas.clientWidth) return;
    const context = fineContext(canvas);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const zoom = 0.8 * Math.min(width, height) / this.size;
    const [c, s] = [Math.cos(this.turn), Math.sin(this.turn)];
    const [ct, st] = [Math.cos(this.tilt), Math.sin(this.tilt)];
    const seen = (p) => {
      const [x, y, z] = p.map((v, k) => v - this.centre[k]);
      const [u, v] = [c * x - s * y, s * x + c * y];
      return [width / 2 + zoom * u, height / 2 - zoom * (ct * z + st * v), ct * v - st * z];
    };
    const errors = this[this.what];
    const colour = (drive) => heat(errors[this.frame * this.drives + drive] / this.most);
    const line = (a, b, stroke, thick) => {
      const [p, q] = [seen(a), seen(b)];
      context.beginPath();
      context.moveTo(p[0], p[1]);
      context.lineTo(q[0], q[1]);
      context.strokeStyle = stroke;
      context.lineWidth = thick;
      context.lineCap = 'round';
      context.stroke();
    };
    context.font = '12px system-ui';
    for (const {start, end, drive} of this.lines) {
      line(this.point(start), this.point(end),
           drive < 0 ? css('--quiet') : colour(drive),
           drive < 0 ? 4 : 8);
    }
    for (const joint of this.joints) {
      const [x, y] = seen(this.point(joint));
      context.beginPath();
      context.arc(x, y, 4, 0, 7);
      context.fillStyle = css('--text');
      context.fill();
    }
    context.fillStyle = css('--quiet');
    for (const [name, at] of Object.entries(this.labels)) {
      const [x, y] = seen(this.point(at));
      context.fillText(name, x + 12, y + 18);
    }
    if (!this.face.length) return;
    context.beginPath();
    this.face.map((corner) => seen(this.point(corner))).forEach(
      ([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fillStyle = 'rgba(230, 159, 0, .55)';
    context.fill();
    context.strokeStyle = css('--text');
    context.lineWidth = 1.5;
    context.stroke();
  }
}

export const drawScale = (canvas) => {
  const context = canvas.getContext('2d');
  for (let k = 0; k < canvas.width; k++) {
    context.fillStyle = heat(k / canvas.width);
    context.fillRect(k, 0, 1, canvas.height);
  }
};
