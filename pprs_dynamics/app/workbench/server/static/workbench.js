/* The workbench's page: asks, shows what is answered, and says when it has been painted. */
'use strict';

const $ = (id) => document.getElementById(id);
const make = (tag, text = '', kind = '') => {
  const node = document.createElement(tag);
  if (text) node.textContent = text;
  if (kind) node.className = kind;
  return node;
};
const titleOf = (name) => name.replaceAll('_', ' ');
/* As many digits as the uncertainty allows. */
const digits = (value, std) => {
  if (value === null || value === undefined) return '–';
  if (!std) return String(+value.toPrecision(5));
  const places = Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(Math.abs(std)))));
  return value.toFixed(places);
};
const amount = (value) => (value === null || value === undefined ? '–'
  : value >= 10 ? value.toFixed(1) : value.toFixed(3));
/* The unit of a drive's quantity, or of the efforts of all drives. */
const unitOf = (drive, quantity = 'effort') => bench.state?.units?.[drive]?.[quantity]
  ?? bench.state?.unit ?? 'N';
const plain = (value) => (value === null || value === undefined ? '…'
  : Math.abs(value) < 9999.5 ? value.toFixed(0).replace('-', '−')
    : `${(value / 1000).toFixed(0).replace('-', '−')} k`);

/* Measured by tests and benchmarks: from an action to the paint that shows its answer [ms]. */
const bench = {latencies: [], settled: [], shares: [], state: null, curves: null};
window.bench = bench;
const afterPaint = (work) => requestAnimationFrame(() => {
  const channel = new MessageChannel();
  channel.port1.onmessage = work;
  channel.port2.postMessage(null);
});

/* -- asking ------------------------------------------------------------------------------- */

const unpack = (buffer) => {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const arrays = {};
  for (const {name, shape} of header.arrays) {
    const size = shape.reduce((a, b) => a * b, 1);
    arrays[name] = {values: new Float32Array(buffer, at, size), shape};
    at += 4 * size;
  }
  return {header, arrays};
};
const rowsOf = ({values, shape}) => Array.from({length: shape[0]}, (_, k) =>
  values.subarray(k * shape[1], (k + 1) * shape[1]));

const ask = async (path, body) => {
  const options = body === undefined ? {} : {
    method: 'POST', body: JSON.stringify(body), headers: {'Content-Type': 'application/json'}};
  const response = await fetch(`/api/${path}`, options);
  if (!response.ok) {
    let text = `${response.status}`;
    try {
      text = (await response.clone().json()).error;
    } catch {
      text = await response.text();
    }
    throw Object.assign(new Error(text), {status: response.status});
  }
  return response.headers.get('content-type').includes('octet-stream')
    ? unpack(await response.arrayBuffer()) : response.json();
};

const tell = (text, isGood = false) => {
  $('message').hidden = !text;
  $('message').textContent = text;
  $('message').classList.toggle('good', isGood);
};

/* Changes go out one after the other, each with the revision that the one before led to. */
let chain = Promise.resolve();
let underway = 0;
const change = (path, body, began) => {
  underway += 1;
  chain = chain.then(async () => {
    try {
      show(await ask(path, {...body, revision: bench.state.revision}));
      if (began !== undefined) {
        afterPaint(() => bench.latencies.push(performance.now() - began));
        bench.pending = began;
      }
      tell('');
    } catch (error) {
      tell(error.message);
      heard = Infinity;
    }
    underway -= 1;
    refresh();
  });
  return chain;
};

/* How many changes the server told of; an answer to a change of ours has them as well. */
let heard = 0;
const hear = (event) => {
  heard = Math.max(heard, Number(event.data));
  refresh();
};

let refreshing = false;
const refresh = async () => {
  if (refreshing) return;
  refreshing = true;
  while (!underway && (!bench.state || heard > bench.state.count)) {
    try {
      const found = await ask('screen');
      if (heard === Infinity) heard = found.header.count;
      show(found);
    } catch (error) {
      tell(error.status ? error.message : 'The workbench does not answer: was it stopped?');
      break;
    }
  }
  refreshing = false;
};

/* -- showing ------------------------------------------------------------------------------ */

let generation = -1;
let curves;
let scatter;
let robot;
let view = 'curves';
let mark = null;
let drawn = '';
let latest = []; // what is left now, by drive
const drawnOf = (state) => [state.generation, state.revision, state.stage].join();

const show = ({header, arrays}) => {
  const last = bench.state;
  // An answer that was overtaken by a later one.
  if (last && header.count < last.count) return;
  bench.state = header;
  if (header.failure) tell(header.failure);
  if (header.has_live) $('live-tab').hidden = false;
  if (header.is_empty) {
    $('verdict').textContent = header.is_beginning ? 'Reading and measuring …'
      : 'No recording is open: add one.';
    if (!header.is_beginning && (!last || last.is_beginning)) open('recordings');
    return;
  }
  latest = rowsOf(arrays.now);
  if (header.generation !== generation) {
    generation = header.generation;
    curves.before = null;
    begin(generation);
  } else if (curves.before && drawnOf(header) !== drawn) {
    curves.setNow(latest);
  }
  drawn = drawnOf(header);
  showVerdict(header);
  showErrors(header);
  showEffects(header);
  showLedger(header);
  showExperiment(header);
  showRecordings(header);
  if (last?.revision !== header.revision || (header.is_settled && !last?.is_settled)) {
    if (mark) where(mark);
    if (view === 'scatter') loadScatter();
    if (view === 'robot') loadRobot();
  }
  if (bench.pending !== undefined && header.stage !== 'linear') {
    const began = bench.pending;
    bench.pending = undefined;
    afterPaint(() => bench.settled.push(performance.now() - began));
  }
};

const begin = async (wanted) => {
  const {header, arrays} = await ask('curves');
  if (wanted !== generation) return; // overtaken
  const {seconds, rest} = arrays;
  const time = Float64Array.from(seconds.values, (s, k) => s + rest.values[k]);
  curves.use(header.drives, time, arrays.segment.values, rowsOf(arrays.before));
  if (latest[0].length === time.length) curves.setNow(latest);
  bench.curves = curves;
  const options = (names) => names.map((name) => {
    const option = make('option', titleOf(name));
    option.value = name;
    return option;
  });
  $('brush-drive').replaceChildren(make('option', 'all drives'), ...options(header.drives));
  $('brush-drive').firstChild.value = '';
  $('scatter-drive').replaceChildren(...options(header.drives));
  for (const [id, start] of [['scatter-x', 'velocity'], ['scatter-y', 'error now']]) {
    $(id).replaceChildren(...options(header.quantities));
    $(id).value = start;
  }
  const worst = Object.entries(bench.state.errors).sort((a, b) => b[1].before - a[1].before)[0];
  if (worst) $('scatter-drive').value = worst[0];
  [$('from').value, $('to').value] = [time[0].toFixed(2), time[time.length - 1].toFixed(2)];
  setMark(null);
  afterPaint(() => { bench.first = performance.now(); });
};

const showVerdict = (state) => {
  const {before, now, noise} = state.overall;
  const words = {adequate: 'the model is adequate', effect: 'effects are missing',
                 ambiguous: 'several effects explain it alike',
                 unknown: 'something no effect explains'};
  const running = Object.values(state.jobs).filter((job) => job.is_running);
  const line = make('span');
  line.append('error ', make('b', `${amount(before)} → ${amount(now)} ${unitOf()}`),
              ` · noise ${amount(noise)} ${unitOf()}${state.noise_is_guess ? ' (first guess)' : ''}`);
  if (state.verdict) line.append(` · diagnosis: ${words[state.verdict]}`);
  const nodes = [line];
  for (const job of running) {
    const what = {diagnose: 'diagnosing', adopt: `judging ${titleOf(job.what)}`,
                  experiment: 'designing'}[job.kind];
    const bar = make('progress');
    bar.max = 1;
    bar.value = job.share;
    bar.setAttribute('aria-label', what);
    const stop = make('button', 'Cancel');
    stop.type = 'button';
    stop.addEventListener('click', () => ask('cancel', {kind: job.kind}).then(show));
    nodes.push(` · ${what} `, bar, ' ', stop);
  }
  $('verdict').replaceChildren(...nodes);
  const adopt = state.jobs.adopt;
  if (adopt && !adopt.is_running && adopt !== shownJob && !sameJob(adopt, shownJob)) {
    shownJob = adopt;
    if (adopt.error) tell(adopt.error);
    else if (adopt.is_cancelled) tell(`${titleOf(adopt.what)} was called off: nothing changed.`);
    else if (state.adoption) {
      tell(`${titleOf(state.adoption.effect)} ${state.adoption.adopted ? 'is adopted'
        : 'is refused'}: ${state.adoption.reason}`, state.adoption.adopted);
    }
  }
  if (adopt && adopt.is_running) shownJob = null;
};
let shownJob = null;
const sameJob = (a, b) => b && a.what === b.what && a.error === b.error
  && a.is_cancelled === b.is_cancelled;

const showErrors = (state) => {
  const entries = Object.entries(state.errors);
  const most = Math.max(...entries.map(([, one]) => Math.max(one.before, one.now)), 1e-9);
  const root = $('errors');
  if (root.children.length !== entries.length) {
    root.replaceChildren(...entries.map(([name]) => {
      const box = make('div', '', 'error');
      box.dataset.drive = name;
      const line = make('div', '', 'name');
      line.append(make('span', name), make('span', '', 'fall'));
      box.append(line, make('canvas'), make('div', '', 'figures'));
      return box;
    }));
  }
  entries.forEach(([name, one], k) => {
    const box = root.children[k];
    const fall = one.before > 0 ? 100 * (one.now / one.before - 1) : 0;
    box.querySelector('.fall').textContent = Math.abs(fall) < 0.5 ? '' : `${fall > 0 ? '+' : '−'}${
      Math.abs(fall).toFixed(0)} %`;
    const figures = box.querySelector('.figures');
    figures.replaceChildren(`${amount(one.before)} → `, make('span', amount(one.now), 'now'),
                            ` → noise ${amount(one.noise)} ${unitOf(name)}`);
    const canvas = box.querySelector('canvas');
    const scale = devicePixelRatio || 1;
    const width = canvas.clientWidth || 140;
    canvas.width = width * scale;
    canvas.height = 22 * scale;
    const context = canvas.getContext('2d');
    context.scale(scale, scale);
    context.fillStyle = css('--before');
    context.fillRect(0, 3, width * one.before / most, 7);
    context.fillStyle = css('--now');
    context.fillRect(0, 12, width * one.now / most, 7);
    if (one.noise !== null) {
      context.fillStyle = css('--noise');
      context.fillRect(Math.min(width * one.noise / most, width - 2), 0, 2, 22);
    }
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `${name}: ${amount(one.before)} before, ${
      amount(one.now)} now, noise ${amount(one.noise)} ${unitOf(name)}`);
  });
};

/* -- effects ------------------------------------------------------------------------------ */

const rows = new Map();
let order = '';

const showEffects = (state) => {
  const list = $('effect-list');
  for (const effect of state.effects) {
    if (!rows.has(effect.name)) rows.set(effect.name, new EffectRow(effect));
    rows.get(effect.name).show(effect, state);
  }
  for (const [name, row] of rows) {
    if (!state.effects.some((effect) => effect.name === name)) row.node.remove();
  }
  // Rows stay where they are under a hand.
  const busy = list.matches(':hover') || list.contains(document.activeElement);
  const score = (one) => (one.is_ticked ? 1e12 : 0) + (one.is_called_for ? 1e11 : 0)
    + (one.evidence ?? -1e9);
  const sorted = [...state.effects].sort((a, b) => score(b) - score(a));
  const wanted = sorted.map((one) => one.name).join();
  if (order.length === 0 || (!busy && state.is_settled && wanted !== order)
      || list.children.length !== state.effects.length) {
    order = wanted;
    list.replaceChildren(...sorted.map((one) => rows.get(one.name).node));
  }
  filter();
  const words = {linear: 'noise and shapes are being fitted …',
                 fitted: state.is_settled ? '' : 'shapes are being fitted …',
                 refined: 'the model is being evaluated …', exact: ''}[state.stage];
  const stage = $('stage');
  stage.replaceChildren(state.is_approximate ? `≈ approximate: ${words}` : words);
  if (state.departure > 0.005) {
    stage.append(make('span', ` Values of yours cost ${state.departure.toFixed(
      state.departure < 10 ? 1 : 0)} against the best (10 are odds of 150 to 1).`, 'departure'));
  }
  if (state.notice) stage.append(` ${state.notice}`);
  $('export-ticked').hidden = !state.effects.some((one) => one.is_ticked);
};

class EffectRow {
  constructor(effect) {
    this.name = effect.name;
    this.node = make('li', '', 'effect');
    this.node.dataset.effect = effect.name;
    const label = make('label');
    this.box = make('input');
    this.box.type = 'checkbox';
    this.box.id = `tick-${effect.name}`;
    this.title = make('span', titleOf(effect.name));
    this.evidence = make('span', '', 'evidence');
    label.append(this.box, this.title, this.evidence);
    this.chips = make('div', '', 'chips');
    this.parameters = make('div');
    this.adopt = make('button', 'Adopt …');
    this.adopt.type = 'button';
    this.adopt.title = 'Judge it on data that it was not fitted to';
    this.release = make('button', 'Best values');
    this.release.type = 'button';
    const actions = make('div', '', 'bar');
    actions.append(this.adopt, this.release);
    this.more = make('div', '', 'more');
    this.more.hidden = true;
    const about = make('button', '?', 'about');
    about.type = 'button';
    about.setAttribute('aria-label', `what is ${titleOf(effect.name)}?`);
    about.setAttribute('aria-expanded', 'false');
    about.addEventListener('click', () => {
      this.more.hidden = !this.more.hidden;
      about.setAttribute('aria-expanded', String(!this.more.hidden));
    });
    for (const [what, key] of [['', 'equation'], ['Looks like: ', 'looks_like'],
                               ['Caused by: ', 'causes'], ['Confirm: ', 'confirm']]) {
      this.more.append(make('p', what + effect[key]));
    }
    this.actions = actions;
    const head = make('div', '', 'head');
    head.append(label, about);
    this.node.append(head, this.chips, this.parameters, actions, this.more);
    this.box.addEventListener('change', (event) => change('tick', {
      effect: this.name, is_ticked: this.box.checked}, event.timeStamp));
    this.adopt.addEventListener('click', () => change('adopt', {effect: this.name}));
    this.release.addEventListener('click', () => change('release', {effect: this.name}));
    this.fields = new Map();
  }

  show(effect, state) {
    this.node.classList.toggle('ticked', effect.is_ticked);
    this.box.checked = effect.is_ticked;
    this.title.replaceChildren(titleOf(effect.name));
    if (effect.bends_columns) {
      const sign = make('abbr', ' ≈');
      sign.title = 'bends how others show: approximate until it is evaluated';
      this.title.append(sign);
    }
    if (effect.is_called_for) this.title.append(' ', make('span', 'called for', 'badge'));
    this.evidence.textContent = effect.evidence === null ? '…' : plain(effect.evidence);
    this.evidence.title = 'evidence: 0 is the threshold, 10 are odds of 150 to 1';
    this.evidence.classList.toggle('pays', effect.evidence > 0);
    this.evidence.classList.toggle('pending', effect.evidence_is_pending);
    this.evidence.setAttribute('aria-label', `evidence ${this.evidence.textContent}${
      effect.evidence_is_pending ? ', pending' : ''}`);
    this.actions.hidden = this.chips.hidden = this.parameters.hidden = !effect.is_ticked;
    if (!effect.is_ticked) return;
    this.adopt.disabled = Boolean(state.jobs.adopt?.is_running);
    this.release.hidden = !effect.parameters.some((one) => one.is_chosen);
    this.showDrives(effect, state);
    this.showParameters(effect);
  }

  showDrives(effect, state) {
    if (!effect.is_on_drives) return;
    if (this.chips.children.length !== state.drives.length) {
      this.chips.replaceChildren(...state.drives.map((drive) => {
        const chip = make('button', drive, 'chip');
        chip.type = 'button';
        chip.addEventListener('click', (event) => {
          const on = new Set(this.drives);
          if (!on.delete(drive)) on.add(drive);
          if (on.size) {
            change('tick', {effect: this.name, drives: [...on]}, event.timeStamp);
          } else {
            change('tick', {effect: this.name, is_ticked: false}, event.timeStamp);
          }
        });
        return chip;
      }));
    }
    this.drives = effect.drives || [];
    for (const chip of this.chips.children) {
      chip.setAttribute('aria-pressed', String(this.drives.includes(chip.textContent)));
    }
  }

  showParameters(effect) {
    const keys = effect.parameters.map((one) => one.key).join();
    if (this.keys !== keys) {
      this.keys = keys;
      this.fields.clear();
      this.parameters.replaceChildren(...effect.parameters.map((one) => this.field(one)));
    }
    for (const one of effect.parameters) {
      const {line, input, range, after} = this.fields.get(one.key);
      line.classList.toggle('chosen', one.is_chosen);
      if (document.activeElement !== input) {
        input.value = one.value === null ? '' : digits(one.value, one.std && 2 * one.std);
      }
      after.textContent = `${one.is_chosen ? '' : one.std === null ? '± … '
        : `± ${(2 * one.std).toPrecision(2)} `}${one.unit === '1' ? '' : one.unit}`;
      if (range && document.activeElement !== range) {
        if (!one.is_chosen) range.dataset.middle = one.value;
        range.value = this.toRange(range, one);
      }
    }
  }

  field(one) {
    const line = make('div', '', 'parameter');
    const label = make('label', `${one.key}`);
    label.title = `${one.symbol}: ${one.description}`;
    const input = make('input');
    input.type = 'number';
    input.step = 'any';
    input.id = `${this.name}-${one.key}`;
    label.htmlFor = input.id;
    const after = make('span', '', 'quiet');
    line.append(label, input, after);
    input.addEventListener('change', (event) => {
      if (input.value !== '') this.choose(one.key, Number(input.value), event.timeStamp);
    });
    let range;
    if (one.is_shape) {
      range = make('input');
      range.type = 'range';
      [range.min, range.max, range.step] = [-100, 100, 1];
      range.setAttribute('aria-label', `${titleOf(this.name)}, ${one.key}: drag its shape`);
      range.addEventListener('input', (event) => this.drag(one, Number(range.value),
                                                           event.timeStamp));
      line.append(range);
    }
    this.fields.set(one.key, {line, input, range, after});
    return line;
  }

  /* A slider is a factor of ten either way, or as much as matters where there is a sign. */
  fromRange(one, at) {
    const middle = Number(this.fields.get(one.key).range.dataset.middle);
    const value = one.is_relative ? middle * 10 ** (at / 100)
      : middle + at / 100 * Math.max(Math.abs(middle), one.scale);
    return Math.min(one.upper, Math.max(one.lower, value));
  }

  toRange(range, one) {
    const middle = Number(range.dataset.middle ?? one.value);
    if (one.value === null) return 0;
    return Math.round(100 * (one.is_relative ? Math.log10(one.value / middle)
      : (one.value - middle) / Math.max(Math.abs(middle), one.scale)));
  }

  /* Only the last place of a drag goes out. */
  drag(one, at, began) {
    this.wanted = [one.key, this.fromRange(one, at), began];
    if (this.dragging) return;
    this.dragging = true;
    const next = () => {
      if (!this.wanted) {
        this.dragging = false;
        return;
      }
      const [key, value, since] = this.wanted;
      this.wanted = null;
      this.choose(key, value, since).then(next);
    };
    next();
  }

  choose(key, value, began) {
    return change('choose', {effect: this.name, key, value}, began);
  }
}

const filter = () => {
  const text = $('filter').value.trim().toLowerCase().replaceAll(' ', '_');
  for (const row of rows.values()) {
    row.node.hidden = Boolean(text) && !row.name.includes(text) && !row.box.checked;
  }
};

/* -- ledger, recordings, experiment ------------------------------------------------------- */

const showLedger = (state) => {
  const start = make('li');
  const first = state.steps[0];
  start.append(make('b', 'model'),
               make('div', first ? `${amount(first.error_before)} ${unitOf()}` : ''));
  $('ledger').replaceChildren(start, ...state.steps.map((step) => {
    const item = make('li');
    item.append(make('b', titleOf(step.effect)), step.drives ? ` on ${step.drives.join(', ')}` : '',
                make('div', `${amount(step.error_before)} → ${amount(step.error_after)} ${unitOf()}`),
                make('div', `held out ${amount(step.held_out_before)} → ${
                  amount(step.held_out_after)} ${unitOf()}`, 'quiet'));
    item.title = `${step.date}, held out on ${step.held_out_on}${step.forced ? ', forced' : ''}`;
    return item;
  }));
  $('undo').disabled = state.steps.length === 0;
};

const showRecordings = (state) => {
  $('strip').replaceChildren(...state.recordings.map((one) => {
    const item = make('li');
    const button = make('button');
    button.type = 'button';
    button.append(make('b', one.name), make('div', `${amount(one.before)} → ${
      amount(one.now)} ${unitOf()}`), make('div', `${(one.end - one.start).toFixed(1)} s`, 'quiet'));
    button.addEventListener('click', () => {
      open('curves');
      curves.zoom([one.start, one.end]);
    });
    item.append(button);
    return item;
  }));
  $('held-out').textContent = state.held_out.length
    ? `Adoptions are judged on ${state.held_out.join(', ')}.`
    : 'Adoptions are judged on blocks of the same recordings: weak evidence. Add one of another '
      + 'motion to judge them on.';
  $('findings').replaceChildren(...state.recordings.flatMap((one) => one.findings.map((text) =>
    make('li', `${one.name}: ${text}`))));
  if (!$('findings').children.length) $('findings').append(make('li', 'none', 'quiet'));
};

const showExperiment = (state) => {
  const found = state.experiment;
  $('experiment-file').hidden = !found;
  const job = state.jobs.experiment;
  $('design').disabled = Boolean(job?.is_running);
  $('experiment-text').textContent = job?.is_running ? `designing … ${
    (100 * job.share).toFixed(0)} %` : job?.error || found?.text || '';
  $('experiment-table').hidden = !found?.contests.length;
  if (found) {
    $('experiment-table').tBodies[0].replaceChildren(...found.contests.map((one) => {
      const row = make('tr');
      row.append(make('td', titleOf(one.truth)), make('td', titleOf(one.rival)),
                 make('td', plain(one.evidence_now)), make('td', plain(one.expected_evidence)));
      return row;
    }));
  }
};

const showFiles = async () => {
  if (!bench.state?.has_folders) return;
  $('folders').hidden = false;
  const {files, surveyed} = await ask('files');
  const offered = [
    ...surveyed.map((one) => [one.name, `robot ${one.robot} · ${one.recording} · ${one.time} · ${
      one.verdict}`]),
    ...files.map((name) => [name, name.slice(name.indexOf('/') + 1)])];
  $('files').replaceChildren(...offered.map(([name, label]) => {
    const item = make('li', '', 'bar');
    item.append(make('span', label));
    for (const [text, heldOut] of [['Open', false], ['Judge on it', true]]) {
      const button = make('button', text);
      button.type = 'button';
      button.disabled = heldOut && Boolean(bench.state.is_empty);
      button.addEventListener('click', async () => {
        try {
          show(await ask('open', {name, is_held_out: heldOut}));
          tell('');
        } catch (error) {
          tell(error.message);
        }
      });
      item.append(button);
    }
    return item;
  }));
};

/* -- marks -------------------------------------------------------------------------------- */

const setMark = (asked) => {
  mark = asked;
  curves.setSpans(null);
  curves.mark(asked?.time ?? null, asked?.drive);
  if (asked?.time) {
    [$('from').value, $('to').value] = asked.time.map((t) => t.toFixed(3));
    $('brush-drive').value = asked.drive || '';
  }
  if (!asked) {
    scatter.region = null;
    scatter.draw();
    $('shares-of').textContent = 'Drag over a curve or a scatter.';
    $('share-list').replaceChildren();
    $('spans').replaceChildren();
  }
};

const where = async (asked, began) => {
  let found;
  try {
    found = await ask('shares', asked);
  } catch (error) {
    tell(error.message);
    return;
  }
  const text = asked.time ? `${asked.time.map((t) => t.toFixed(2)).join(' to ')} s on ${
    asked.drive || 'all drives'}` : `a region of ${asked.drive}`;
  $('shares-of').textContent = `Of the squared error now in ${text} (${found.samples} samples), `
    + 'less the price of each effect:';
  const told = found.shares.filter((one) => one.net > 0.005).slice(0, 8);
  $('share-list').replaceChildren(...told.map((one) => {
    const item = make('li');
    const button = make('button');
    button.type = 'button';
    button.title = `explains ${(100 * one.explained).toFixed(1)} % there; tick it`;
    const bar = make('canvas');
    button.append(make('span', `${titleOf(one.effect)}${one.drives ? ` on ${
      one.drives.join(', ')}` : ''}`), make('b', `${(100 * one.net).toFixed(0)} %`), bar);
    button.addEventListener('click', (event) => change('tick', {effect: one.effect},
                                                       event.timeStamp));
    item.append(button);
    const context = bar.getContext('2d');
    [bar.width, bar.height] = [200, 8];
    context.fillStyle = css('--line');
    context.fillRect(0, 0, 200, 8);
    context.fillStyle = css('--before');
    context.fillRect(0, 0, 200 * Math.max(one.explained, 0), 8);
    context.fillStyle = css('--now');
    context.fillRect(0, 0, 200 * one.net, 8);
    return item;
  }));
  if (!told.length) $('share-list').append(make('li', 'No effect explains it and pays its price.'));
  $('spans').replaceChildren();
  if (!asked.time && found.spans.length) {
    const jump = make('button', `Show when: ${found.spans.length} span${
      found.spans.length > 1 ? 's' : ''}, the longest at ${found.spans[0][0].toFixed(2)} s`);
    jump.type = 'button';
    jump.addEventListener('click', () => {
      open('curves');
      const [a, b] = found.spans[0];
      const margin = Math.max(0.5, b - a);
      curves.setSpans(found.spans);
      curves.zoom([a - margin, b + margin]);
    });
    $('spans').append(jump);
  }
  if (began !== undefined) afterPaint(() => bench.shares.push(performance.now() - began));
};

/* -- views -------------------------------------------------------------------------------- */

const open = (name) => {
  view = name;
  for (const tab of document.querySelectorAll('[role=tab]')) {
    const chosen = tab.dataset.view === name;
    tab.setAttribute('aria-selected', String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    $(`view-${tab.dataset.view}`).hidden = !chosen;
  }
  robot.pause();
  $('play').setAttribute('aria-pressed', 'false');
  if (name === 'scatter') loadScatter();
  if (name === 'robot') loadRobot();
  if (name === 'recordings') showFiles();
  if (name === 'live') showLive();
  if (name === 'curves') curves.resize();
};

const loadScatter = async () => {
  const [x, y, drive] = ['scatter-x', 'scatter-y', 'scatter-drive'].map((id) => $(id).value);
  if (!drive) return;
  const {arrays} = await ask(`scatter?${new URLSearchParams({x, y, drive})}`);
  const {region} = scatter;
  const same = scatter.names[0] === x && scatter.names[1] === y;
  scatter.use([x, y], arrays.x.values, arrays.y.values, drive);
  if (same && mark && !mark.time) {
    scatter.region = region;
    scatter.draw();
  }
};

const loadRobot = async () => {
  if (!bench.state || bench.state.is_empty) return;
  try {
    const {header, arrays} = await ask('robot');
    $('robot-time').max = arrays.time.values.length - 1;
    robot.use(arrays.time.values, arrays.joints.values, arrays.before.values, arrays.now.values,
              header.angles);
    $('robot-most').textContent = `0 to ${amount(robot.most)} ${unitOf()}`;
    robot.moved(robot.frame);
  } catch (error) {
    tell(error.message);
  }
};

const prepare = () => {
  curves = new Curves($('curves'), (asked) => {
    const began = performance.now();
    setMark(asked);
    where(asked, began);
  });
  scatter = new Scatter($('scatter'), (region) => {
    const began = performance.now();
    mark = {x: $('scatter-x').value, y: $('scatter-y').value, drive: $('scatter-drive').value,
            ...region};
    curves.mark(null);
    where(mark, began);
  });
  robot = new Robot($('robot'), (frame) => {
    $('robot-time').value = frame;
    $('robot-clock').textContent = `${robot.time[frame].toFixed(2)} s`;
  });
  Object.assign(bench, {curves, scatter, robot});
  drawScale($('robot-scale'));
  const tabs = [...document.querySelectorAll('[role=tab]')];
  for (const tab of tabs) {
    if (tab.dataset.view === 'live') tab.id = 'live-tab';
    tab.setAttribute('aria-controls', `view-${tab.dataset.view}`);
    tab.addEventListener('click', () => open(tab.dataset.view));
    tab.addEventListener('keydown', (event) => {
      const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
      if (!step) return;
      const shown = tabs.filter((one) => !one.hidden);
      const next = shown[(shown.indexOf(tab) + step + shown.length) % shown.length];
      open(next.dataset.view);
      next.focus();
    });
  }
  $('filter').addEventListener('input', filter);
  $('brush').addEventListener('submit', (event) => {
    event.preventDefault();
    const asked = {time: [Number($('from').value), Number($('to').value)],
                   drive: $('brush-drive').value || null};
    setMark(asked);
    where(asked, event.timeStamp);
  });
  $('zoom').addEventListener('click', () => curves.zoom([Number($('from').value),
                                                         Number($('to').value)]));
  $('all').addEventListener('click', () => curves.all());
  for (const id of ['scatter-x', 'scatter-y', 'scatter-drive']) {
    $(id).addEventListener('change', () => {
      setMark(null);
      loadScatter();
    });
  }
  $('play').addEventListener('click', () => {
    const plays = !robot.playing;
    $('play').setAttribute('aria-pressed', String(plays));
    if (plays) robot.play();
    else robot.pause();
  });
  $('robot-time').addEventListener('input', () => {
    robot.pause();
    robot.go(Number($('robot-time').value));
  });
  $('robot-error').addEventListener('change', () => {
    robot.what = $('robot-error').value;
    robot.draw();
  });
  $('undo').addEventListener('click', () => change('undo', {}));
  $('design').addEventListener('click', () => ask('experiment', {
    duration: Number($('experiment-duration').value)}).then(show, (error) => tell(error.message)));
  $('invite').addEventListener('click', async () => tell(
    `For one more browser, good once: ${(await ask('invite', {})).address}`, true));
  $('upload').addEventListener('change', async () => {
    const [file] = $('upload').files;
    if (!file) return;
    const query = new URLSearchParams({name: file.name,
                                       held_out: $('upload-held-out').checked ? '1' : '0'});
    const response = await fetch(`/api/upload?${query}`, {method: 'POST', body: file});
    if (response.ok) {
      tell('');
      show(unpack(await response.arrayBuffer()));
    } else {
      tell(await response.json().then((found) => found.error, () => `${response.status}`));
    }
    $('upload').value = '';
  });
  $('help').addEventListener('click', () => $('keys').showModal());
  $('close-keys').addEventListener('click', () => $('keys').close());
  document.addEventListener('keydown', (event) => {
    if (event.target.matches('input:not([type=checkbox]), select') || event.ctrlKey
        || event.metaKey || event.altKey) return;
    const shown = tabs.filter((tab) => !tab.hidden);
    if (event.key === '/') {
      event.preventDefault();
      $('filter').focus();
    } else if (event.key === 'Escape') setMark(null);
    else if (event.key === 'z' && mark?.time) curves.zoom(mark.time);
    else if (event.key === 'a') curves.all();
    else if (shown[Number(event.key) - 1]) open(shown[Number(event.key) - 1].dataset.view);
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    if (bench.state?.errors) showErrors(bench.state);
  });
  prepareLive();
  const events = new EventSource('/api/events');
  events.onmessage = hear;
  events.onerror = () => tell('The workbench does not answer: was it stopped?');
  events.onopen = () => tell('');
};

/* -- live --------------------------------------------------------------------------------- */

let livePlots = [];

const showLive = async () => {
  if (view !== 'live' || !bench.state?.has_live) return;
  let found;
  try {
    found = await ask('live');
  } catch (error) {
    $('live-state').textContent = error.message;
    return;
  }
  bench.live = found;
  const rms = (values) => {
    const known = values.filter((v) => v !== null);
    return known.length ? Math.sqrt(known.reduce((a, v) => a + v * v, 0) / known.length) : null;
  };
  const running = found.age !== null && found.age < 2;
  const monitor = found.monitor_error
    ? ` · the monitor says ${amount(rms(found.monitor_error))} ${unitOf()}` : '';
  $('live-state').textContent = running
    ? `error of the last 2 s ${amount(rms(found.error))} ${unitOf()} with ${found.effects.length
      ? found.effects.map(titleOf).join(', ') : 'no added effect'}${monitor} · ${
      found.kept.toFixed(0)} s kept${found.trouble ? ` · ${found.trouble}` : ''}`
    : `Nothing comes in on joint_states${found.received ? ' any more' : ''}. ${found.trouble}`;
  $('live-take').disabled = !found.kept;
  if (!found.residual.length) return;
  const origin = found.time[found.time.length - 1];
  const time = found.time.map((t) => t - origin);
  const root = $('live-curves');
  if (livePlots.length !== found.drives.length) {
    root.replaceChildren();
    const axis = {stroke: css('--quiet'), grid: {stroke: css('--line'), width: 1},
                  font: '12px system-ui'};
    livePlots = found.drives.map((drive, d) => {
      const box = make('div', '', 'curve');
      const head = make('h3', drive);
      const reading = make('span');
      head.append(reading);
      box.append(head);
      root.append(box);
      const plot = new uPlot({
        width: Math.max(root.clientWidth, 100), height: 84, legend: {show: false},
        padding: [8, 6, 0, 0], cursor: {show: false}, scales: {x: {time: false}},
        axes: [{...axis, size: 20, values: (u, ticks) => ticks.map((t) => `${t} s`)},
               {...axis, size: 62, space: 22,
                values: (u, ticks) => ticks.map((t) => `${+t.toPrecision(3)} ${unitOf(drive)}`)}],
        series: [{}, {stroke: css('--now'), width: 1, points: {show: false}}],
      }, [time, found.residual[d]], box);
      return {plot, reading};
    });
  }
  livePlots.forEach(({plot, reading}, d) => {
    plot.setData([time, found.residual[d]]);
    reading.textContent = `${amount(found.error[d])} ${unitOf(found.drives[d])}`;
  });
};

const prepareLive = () => {
  setInterval(showLive, 400);
  $('live-set').addEventListener('click', async () => {
    try {
      const {nodes} = await ask('live/set', {});
      $('live-nodes').replaceChildren(...Object.entries(nodes).map(([name, said]) =>
        make('li', `${name}: ${said || 'took the effects'}`)));
      tell('');
    } catch (error) {
      tell(error.message);
    }
  });
  $('live-take').addEventListener('click', async () => {
    try {
      show(await ask('live/take', {}));
      tell('What came in last is a recording of this session now.', true);
    } catch (error) {
      tell(error.message);
    }
  });
};

prepare();
