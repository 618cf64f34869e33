// What-if fits: solves for the effects that are ticked and draws what they leave.
'use strict';
(() => {
  const part = document.getElementById('what-if');
  const MOST_ROUNDS = 12;  // until the numbers at their limits are known
  let data, size, gram, side, cells, status, isDrawn = false;
  let L, factored = [], held = [], beyond = [];  // the factor; signs of numbers beyond their limits
  const ticked = new Set();  // placements
  const charts = [];

  function numbers(letters, Kind) {
    return new Kind(Uint8Array.from(atob(letters), (one) => one.charCodeAt(0)).buffer);
  }

  // Coefficients of a set of placements and the cost of the set, as `NormalEquations.solve`.
  // Rows of the Cholesky factor are kept as far as the next set begins with the same columns.
  function fit(placements) {
    const free = [...data.always, ...placements.flatMap((one) => one.columns)];
    const fixed = placements.flatMap((one) => one.fixed);
    const n = free.length, c = new Float64Array(size), z = new Float64Array(n);
    const {deviations, steepness} = data;
    let logDet = 0;
    fixed.forEach((k) => { c[k] = 1; });
    for (let round = 0; round < MOST_ROUNDS; round++) {
      let first = 0;
      while (first < n && free[first] === factored[first] && (beyond[first] ?? 0) === (held[first] ?? 0)) first++;
      for (let i = first; i < n; i++) {
        for (let j = 0; j <= i; j++) {
          let sum = gram[free[i] * size + free[j]];
          if (i === j) sum = sum * (1 + 1e-12) + steepness * Math.abs(beyond[i] ?? 0);
          for (let k = 0; k < j; k++) sum -= L[i * size + k] * L[j * size + k];
          L[i * size + j] = i === j ? Math.sqrt(sum) : sum / L[j * size + j];
        }
      }
      factored = free;
      held = [...beyond];
      logDet = 0;
      for (let i = 0; i < n; i++) {
        let b = side[free[i]] + steepness * deviations * (beyond[i] ?? 0);
        for (const k of fixed) b -= gram[free[i] * size + k];
        for (let j = 0; j < i; j++) b -= L[i * size + j] * z[j];
        z[i] = b / L[i * size + i];
        logDet += 2 * Math.log(L[i * size + i]);
      }
      for (let i = n - 1; i >= 0; i--) {
        let sum = z[i];
        for (let k = i + 1; k < n; k++) sum -= L[k * size + i] * c[free[k]];
        c[free[i]] = sum / L[i * size + i];
      }
      beyond = data.always.map((k) => (data.limited.has(k) && Math.abs(c[k]) > deviations
        ? Math.sign(c[k]) : 0));
      if (beyond.every((sign, i) => sign === held[i])) break;
    }
    let cost = logDet;
    const all = [...free, ...fixed];
    for (const i of all) {
      cost -= 2 * side[i] * c[i];
      for (const j of all) cost += c[i] * c[j] * gram[i * size + j];
    }
    data.always.forEach((k, i) => {
      if (beyond[i]) cost += steepness * (Math.abs(c[k]) - deviations) ** 2;
    });
    for (const one of placements) {
      cost += one.price;
      if (one.signs.some(([k, bound]) => c[k] < bound)) cost += data.wrongSignPrice;
    }
    for (const effect of data.effects) {
      const used = effect.placements.filter((one) => placements.includes(one));
      cost += data.namePrice * new Set(used.flatMap((one) => one.hypotheses)).size;
      if (used.length && used[0].drive) cost += data.drivePrices[used.length - 1];
    }
    return {c, cost};
  }

  // Sum of squares that coefficients leave on a drive.
  function squares({columns, products}, c) {
    const n = columns.length + 1, weights = weightsOf({columns}, c);
    let sum = 0;
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < n; j++) sum += weights[i] * weights[j] * products[i * n + j];
    }
    return Math.max(sum, 0);
  }

  // A weighted sum of rows of a drive over time; null where nothing was measured.
  function curve({rows, scales, points}, weights) {
    const sum = new Float64Array(points);
    weights.forEach((weight, r) => {
      const factor = weight * scales[r], first = r * points;
      if (factor) for (let t = 0; t < points; t++) sum[t] += factor * rows[first + t];
    });
    const first = points * weights.lastIndexOf(1);
    return Array.from(sum, (value, t) => (rows[first + t] === data.gap ? null : value));
  }

  // Of a drive's columns, of the error and of the error as given.
  function weightsOf({columns}, c) {
    return [...Array.from(columns, (k) => -c[k]), 1, 0];
  }

  function update() {
    const chosen = data.effects.flatMap((effect) => effect.placements)
      .filter((one) => ticked.has(one));
    const now = fit(chosen);
    const isBent = data.effects.some((effect) => effect.isApproximate
      && effect.placements.some((one) => one.isFound !== ticked.has(one)));
    const sign = isBent ? '≈ ' : '';
    const show = (cell, value, digits) => {
      cell.value = value;
      cell.textContent = `${sign}${value.toFixed(digits)}`;
    };
    let sum = 0, samples = 0;
    data.drives.forEach((drive, d) => {
      const left = squares(drive, now.c);
      sum += left;
      samples += drive.samples;
      show(cells[d + 1].now, Math.sqrt(left / drive.samples), 3);
      // The span that is zoomed to stays; a chart finds its own before it is drawn first.
      charts[d].setData([drive.time, drive.before, curve(drive, weightsOf(drive, now.c))], !isDrawn);
      if (isDrawn) charts[d].redraw();
    });
    isDrawn = true;
    show(cells[0].now, Math.sqrt(sum / samples), 3);
    cells.forEach(({now: {value}, bar}) => { bar.style.width = `${100 * value / data.largest}%`; });
    const own = (effect) => effect.placements.filter((one) => ticked.has(one));
    for (const effect of data.effects) {
      effect.box.checked = own(effect).length > 0;
      effect.placements.forEach((one) => { if (one.box) one.box.checked = ticked.has(one); });
      if (effect.box.checked) continue;
      const more = effect.placements.filter((one) => one.isFirstChoice);
      show(effect.evidence, now.cost - fit([...chosen, ...more]).cost, 0);
    }
    // From the last one on the factor stays good for what stands before.
    for (const effect of data.effects.filter(({box}) => box.checked).reverse()) {
      const mine = own(effect), rest = chosen.filter((one) => !mine.includes(one));
      show(effect.evidence, fit(rest).cost - now.cost, 0);
    }
    const names = data.effects.filter((effect) => effect.box.checked).map((one) => one.name);
    status.textContent = `With ${names.join(', ') || 'nothing'} in the model the error would be `
      + `${cells[0].now.textContent} N.`;
  }

  function element(name, parent, text = '', properties = {}) {
    const made = Object.assign(document.createElement(name), properties);
    made.append(text);
    parent.append(made);
    return made;
  }

  function box(parent, text, label, change) {
    const place = element('label', parent);
    const made = element('input', place, '', {type: 'checkbox', ariaLabel: label});
    place.append(` ${text}`);
    made.addEventListener('change', () => { change(made.checked); update(); });
    return made;
  }

  function list() {
    const body = part.querySelector('.effects tbody');
    for (const effect of data.effects) {
      const row = element('tr', body), head = element('th', row, '', {scope: 'row'});
      const mark = effect.isApproximate ? ' ≈' : '';
      effect.box = box(head, effect.name + mark, effect.name, (on) => {
        effect.placements.forEach((one) => ticked.delete(one));
        if (on) effect.placements.filter((one) => one.isFirstChoice).forEach((one) => ticked.add(one));
      });
      const places = element('div', head, '', {className: 'places'});
      for (const one of effect.placements.filter(({drive}) => drive)) {
        one.box = box(places, one.drive, `${effect.name} on ${one.drive}`, (on) => {
          ticked[on ? 'add' : 'delete'](one);
        });
      }
      effect.evidence = element('data', element('td', row));
    }
    part.querySelector('button').addEventListener('click', () => { asFound(); update(); });
  }

  function errors() {
    const body = part.querySelector('.errors tbody');
    const total = data.drives.reduce((sum, one) => sum + one.samples, 0);
    const given = Math.sqrt(data.drives.reduce(
      (sum, one) => sum + one.samples * one.given ** 2, 0) / total);
    const rows = [{name: 'all drives', given, noise: Math.sqrt(data.drives.reduce(
      (sum, one) => sum + one.noise ** 2, 0) / data.drives.length)}, ...data.drives];
    data.largest = Math.max(...rows.map((one) => Math.max(one.noise, one.given)));
    cells = rows.map(({name, given: before, noise}) => {
      const row = element('tr', body);
      element('th', row, name, {scope: 'row'});
      element('td', row, before.toFixed(3));
      const now = element('data', element('td', row));
      element('td', row, noise.toFixed(3));
      const bar = element('span', element('td', row), '', {className: 'bar', ariaHidden: true});
      element('i', bar, '', {className: 'before'}).style.width = `${100 * before / data.largest}%`;
      const after = element('i', bar, '', {className: 'after'});
      element('i', bar, '', {className: 'noise'}).style.left = `${100 * noise / data.largest}%`;
      return {now, bar: after};
    });
  }

  function asFound() {
    ticked.clear();
    data.effects.forEach(({placements}) => placements.filter((one) => one.isFound)
      .forEach((one) => ticked.add(one)));
  }

  function chart(drive, holder) {
    const style = (name) => () => getComputedStyle(part).getPropertyValue(name);
    const place = element('div', holder, '', {className: 'chart'});
    const title = element('p', place, drive.name);
    const highest = Math.max(2.5 * drive.noise, ...drive.before.map((value) => Math.abs(value)));
    const axis = {stroke: style('--text'), grid: {stroke: style('--line'), width: 1},
                  ticks: {show: false}, font: '12px system-ui, sans-serif'};
    const made = new uPlot({
      width: place.clientWidth, height: 150, padding: [8, 8, 0, 0], legend: {show: false},
      scales: {x: {time: false}, y: {range: [-highest, highest]}},
      cursor: {y: false, sync: {key: 'what-if', scales: ['x', null]}},
      axes: [{...axis, size: 24}, {...axis, size: 52}],
      series: [{}, {stroke: style('--before'), width: 1}, {stroke: style('--after'), width: 1.5}],
      hooks: {
        draw: [({ctx, bbox, valToPos}) => {
          ctx.save();
          ctx.strokeStyle = style('--noise')();
          ctx.setLineDash([2, 4]);
          for (const level of [-2 * drive.noise, 2 * drive.noise]) {
            ctx.beginPath();
            ctx.moveTo(bbox.left, valToPos(level, 'y', true));
            ctx.lineTo(bbox.left + bbox.width, valToPos(level, 'y', true));
            ctx.stroke();
          }
          ctx.restore();
        }],
        setCursor: [({cursor: {idx}, data: [time, before, now]}) => {
          title.textContent = idx == null || before[idx] === null ? drive.name
            : `${drive.name} at ${time[idx].toFixed(2)} s: ${before[idx].toFixed(3)} N as given, `
              + `${now[idx].toFixed(3)} N now`;
        }],
      },
    }, [drive.time, drive.before, drive.before], place);
    made.root.role = 'img';
    made.root.ariaLabel = `Error of ${drive.name} over time, as given and with the effects ticked.`;
    new ResizeObserver(() => made.setSize({width: place.clientWidth, height: 150})).observe(place);
    return made;
  }

  async function begin() {
    data = JSON.parse(document.getElementById('what-if-data').textContent);
    gram = numbers(data.gram, Float64Array);
    side = numbers(data.side, Float64Array);
    size = side.length;
    L = new Float64Array(size * size);
    beyond = data.always.map(() => 0);
    data.limited = new Set(data.limited);
    for (const drive of data.drives) {
      drive.time = [...numbers(drive.time, Float32Array)];
      drive.rows = numbers(drive.rows, Int16Array);
      drive.scales = numbers(drive.scales, Float64Array);
      drive.products = numbers(drive.products, Float64Array);
      drive.points = drive.time.length;
      drive.before = curve(drive, [...drive.columns.map(() => 0), 0, 1]);
    }
    status = part.querySelector('[role=status]');
    errors();
    list();
    asFound();
    const holder = part.querySelector('.charts');
    await window.library('uplot');
    charts.push(...data.drives.map((drive) => chart(drive, holder)));
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      charts.forEach((one) => one.redraw());
    });
    update();
    part.dataset.ready = '';
  }

  part.closest('details').addEventListener('toggle', begin, {once: true});
})();
