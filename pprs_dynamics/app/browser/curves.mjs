/* Linked curves over time, one of each drive: what is left before and now. */

import {css, make, whenDark} from './dom.mjs';
import {signed} from './format.mjs';

/* Gaps are null to uPlot; typed arrays stay typed where there are none. */
export const withGaps = (values) => {
  for (let k = 0; k < values.length; k++) {
    if (Number.isNaN(values[k])) return Array.from(values, (v) => (Number.isNaN(v) ? null : v));
  }
  return values;
};

/* Let no line go from one recording or segment to the next. */
export const cut = (row, segment) => {
  let gapped = withGaps(row);
  for (let k = 1; k < (segment?.length ?? 0); k++) {
    if (segment[k] !== segment[k - 1]) {
      if (gapped === row) gapped = Array.from(row);
      gapped[k] = null;
    }
  }
  return gapped;
};

export class Curves {
  /* `marked` is called with {time: [from, to], drive}, `unitOf` with a drive. */
  constructor(root, marked, unitOf) {
    this.root = root;
    this.marked = marked;
    this.unitOf = unitOf;
    this.plots = [];
    this.drives = [];
    this.source = null;
    this.window = null; // what is seen; null is all
    this.heights = new Map(); // of the error that is seen, by drive; those that are not: all
    this.playhead = null; // [s]
    this.moved = () => {}; // called with what is seen, when that is another
    this.went = () => {}; // called with the time that was clicked on
    new ResizeObserver(() => this.resize()).observe(root);
    whenDark(() => this.build());
    root.addEventListener('keydown', (event) => this.key(event));
  }

  /* Take the times and the error before of every drive; the error now follows. */
  use(drives, time, segment, before) {
    this.drives = drives;
    this.time = time;
    this.before = before.map((row) => cut(row, segment));
    this.segment = segment;
    this.now = this.before;
    this.window = null;
    this.heights.clear();
    this.build();
  }

  build() {
    for (const plot of this.plots) plot.destroy();
    this.root.replaceChildren();
    this.plots = this.drives.map((drive, d) => this.plot(drive, d));
    if (this.window) this.zoom(this.window);
  }

  plot(drive, d) {
    const box = make('div', '', 'curve');
    const head = make('h3', drive);
    const reading = make('span');
    head.append(reading);
    const place = make('div', '', 'over-time', {tabIndex: 0});
    place.setAttribute('role', 'img');
    place.setAttribute('aria-label', `error of ${drive} over time, before and now`);
    box.append(head, place);
    this.root.append(box);
    const axis = {stroke: css('--quiet'), grid: {stroke: css('--line'), width: 1},
                  ticks: {stroke: css('--line'), size: 4}, font: '12px system-ui', gap: 3};
    const is_last = d === this.drives.length - 1;
    const plot = new uPlot({
      width: Math.max(this.root.clientWidth, 100), height: this.height() + (is_last ? 24 : 0),
      padding: [8, 6, 0, 0], legend: {show: false},
      cursor: {sync: {key: 'time', setSeries: false, scales: ['x', null]}, points: {show: false},
               drag: {x: true, y: false, setScale: false}, y: false},
      scales: {x: {time: false},
               y: {range: (u, min, max) => this.heights.get(drive)
                 ?? uPlot.rangeNum(min ?? 0, max ?? 0, 0.1, true)}},
      axes: [{...axis, size: is_last ? 30 : 6,
              values: is_last ? (u, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`)
                : (u, ticks) => ticks.map(() => '')},
             {...axis, size: 62, values: (u, ticks) => ticks.map(
               (t) => `${+t.toPrecision(3)} ${this.unitOf(drive)}`), space: 15}],
      series: [{},
               {stroke: css('--before'), width: 1, points: {show: false}},
               {stroke: css('--now'), width: 1, points: {show: false}}],
      hooks: {
        setSelect: [(u) => this.select(u, d)],
        setCursor: [(u) => this.read(u, reading, drive)],
        draw: [(u) => this.bands(u), (u) => this.line(u)],
      },
    }, [this.time, this.before[d], this.now[d]], place);
    plot.over.addEventListener('mousedown', () => { this.source = plot; });
    plot.over.addEventListener('dblclick', () => this.all());
    plot.over.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !event.shiftKey && !event.altKey) return; // the page scrolls
      event.preventDefault();
      const factor = (event.deltaY || event.deltaX) > 0 ? 1.25 : 0.8;
      const around = (at, [a, b]) => [at - (at - a) * factor, at + (b - at) * factor];
      if (event.altKey) {
        const seen = [plot.scales.y.min, plot.scales.y.max];
        const [min, max] = around(plot.posToVal(event.offsetY, 'y'), seen);
        this.heights.set(drive, [min, max]);
        plot.setScale('y', {min, max});
      } else this.zoom(around(plot.posToVal(event.offsetX, 'x'), this.range()));
    }, {passive: false});
    plot.over.addEventListener('click', (event) => {
      if (plot.select.width < 3) this.went(plot.posToVal(event.offsetX, 'x'));
    });
    return plot;
  }

  /* Of one curve: six fit on a screen [px]. */
  height() {
    return Math.round(Math.min(Math.max((innerHeight - 285) / this.drives.length - 22, 64), 150));
  }

  /* Show what is left now; rows are those of the drives. */
  setNow(rows) {
    this.now = rows.map((row) => cut(row, this.segment));
    this.plots.forEach((plot, d) => {
      plot.setData([this.time, this.before[d], this.now[d]], false);
      const [min, max] = this.range();
      plot.setScale('x', {min, max});
    });
  }

  range() {
    return this.window || [this.time[0], this.time[this.time.length - 1]];
  }

  /* Curves of each drive; `range` is the part that is seen. */
  seen() {
    return this.drives.map((drive, d) => ({
      drive, unit: this.unitOf(drive), time: this.time, before: this.before[d],
      now: this.now[d]}));
  }

  zoom(range) {
    if (!this.plots.length || (range && !(range[1] > range[0]))) return;
    this.window = range;
    const [min, max] = this.range();
    for (const plot of this.plots) plot.setScale('x', {min, max});
    // The places of marks follow once the scales are in force.
    queueMicrotask(() => this.show());
    this.moved(range);
  }

  all() {
    this.heights.clear();
    this.zoom(null);
  }

  /* Draw a line where the robot is. */
  goTo(time) {
    this.playhead = time;
    for (const plot of this.plots) plot.redraw(false);
  }

  line(u) {
    if (this.playhead === null) return;
    const x = u.valToPos(this.playhead, 'x', true);
    if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) return;
    u.ctx.save();
    u.ctx.strokeStyle = css('--chosen');
    u.ctx.lineWidth = 1.5;
    u.ctx.beginPath();
    u.ctx.moveTo(x, u.bbox.top);
    u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
    u.ctx.stroke();
    u.ctx.restore();
  }

  select(u, d) {
    if (u !== this.source || u.select.width < 3) return;
    this.source = null;
    const time = [u.posToVal(u.select.left, 'x'),
                  u.posToVal(u.select.left + u.select.width, 'x')];
    this.marked({time, drive: this.drives[d]});
  }

  /* Mark a span on one drive, or on all without one; null forgets it. */
  mark(time, drive) {
    this.span = time;
    this.on = drive;
    this.show();
  }

  show() {
    this.plots.forEach((plot, d) => {
      if (!this.span || (this.on && this.on !== this.drives[d])) {
        plot.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
        return;
      }
      const left = Math.max(plot.valToPos(this.span[0], 'x'), 0);
      const right = Math.min(plot.valToPos(this.span[1], 'x'), plot.over.clientWidth);
      plot.setSelect({left, width: Math.max(right - left, 0), top: 0,
                      height: plot.over.clientHeight}, false);
    });
  }

  /* Spans of time in which samples of a scatter lie. */
  setSpans(spans) {
    this.spans = spans;
    for (const plot of this.plots) plot.redraw(false);
  }

  bands(u) {
    if (!this.spans || !this.spans.length) return;
    u.ctx.save();
    u.ctx.fillStyle = css('--mark');
    for (const [from, to] of this.spans) {
      const left = u.valToPos(from, 'x', true);
      u.ctx.fillRect(left, u.bbox.top, Math.max(u.valToPos(to, 'x', true) - left, 1.5),
                     u.bbox.height);
    }
    u.ctx.restore();
  }

  read(u, reading, drive) {
    const k = u.cursor.idx;
    if (k === null || k === undefined || u.cursor.left < 0) {
      reading.textContent = '';
      return;
    }
    reading.textContent = `${u.data[0][k].toFixed(2)} s: ${signed(u.data[1][k])} → `
      + `${signed(u.data[2][k])} ${this.unitOf(drive)}`;
  }

  key(event) {
    const steps = {ArrowLeft: [-0.1, -0.1], ArrowRight: [0.1, 0.1], '+': [0.1, -0.1],
                   '-': [-0.125, 0.125]};
    const step = steps[event.key];
    if (!step || !event.target.classList.contains('over-time')) return;
    event.preventDefault();
    const [a, b] = this.range();
    this.zoom([a + step[0] * (b - a), b + step[1] * (b - a)]);
  }

  resize() {
    const width = Math.max(this.root.clientWidth, 100);
    this.plots.forEach((plot) => {
      if (plot.width !== width) plot.setSize({width, height: plot.height});
    });
    this.show();
  }
}
