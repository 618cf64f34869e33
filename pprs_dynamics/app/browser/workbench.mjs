/* The page of the workbench: sends requests, shows answers, and marks when they are painted. */

import {read, written} from './address.mjs';
import {csvOf, save, svgOf} from './curve_files.mjs';
import {Curves} from './curves.mjs';
import {$, afterPaint, make, whenDark} from './dom.mjs';
import {EffectList} from './effects.mjs';
import {showErrors} from './errors.mjs';
import {amount, titleOf, unitOf} from './format.mjs';
import {Live} from './live.mjs';
import {adoptionText, showExperiment, showFiles, showJobs, showLedger, showRecordings, showStage,
        showVerdict} from './panels.mjs';
import {drawScale, Robot} from './robot.mjs';
import {Scatter} from './scatter.mjs';
import {followScheme, switchScheme} from './scheme.mjs';
import {Client, rowsOf} from './client.mjs';
import {showShares} from './shares.mjs';

/* Measured by tests and benchmarks: from an action to the paint that shows its answer [ms]. */
const bench = {latencies: [], settled: [], shares: [], curves: null,
               get state() { return server.state; }, get live() { return live.found; }};
window.bench = bench;
const noted = (list, began) => afterPaint(() => list.push(performance.now() - began));

let view = 'curves';
let mark = null; // what somebody asks about
let latest = []; // what is left now, by drive
let pending; // when the tick was made whose fit is awaited
let isPressed = false; // whether something that can be clicked is
let held = null; // what came meanwhile
let wanted = null; // what the address asks to see, until it is seen

const unit = (drive, quantity) => unitOf(server.state, drive, quantity);
const tabs = [...document.querySelectorAll('[role=tab]')];
const seenTabs = () => tabs.filter((tab) => !tab.hidden);

/* -- showing ------------------------------------------------------------------------------ */

const report = (text, isGood = false) => {
  $('message').hidden = !text;
  $('message').textContent = text;
  $('message').classList.toggle('good', isGood);
};

/* A button that moves between press and release is never clicked: what comes then is shown after. */
const show = (last, state, arrays) => {
  if (isPressed) {
    held = {last: held ? held.last : last, state, arrays: {...held?.arrays, ...arrays}};
    return;
  }
  if (state.failure) report(state.failure);
  $('live-tab').hidden = !state.has_live;
  if (state.is_empty) {
    $('verdict').textContent = state.is_beginning ? 'Reading and measuring …'
      : 'No recording is open: add one.';
    if (!state.is_beginning && last?.is_beginning !== false) open('recordings');
    return;
  }
  if (arrays.now) latest = rowsOf(arrays.now);
  if (state.fitted_since !== last?.fitted_since) begin(state.fitted_since);
  else if (arrays.now && curves.before) curves.setNow(latest);
  showVerdict(state);
  showJobs(Object.values(state.jobs), (kind) => server.run('cancel', {kind}));
  showErrors($('errors'), state);
  effects.show(state);
  showStage(state);
  showLedger(state);
  showExperiment(state);
  showRecordings(state, (span) => {
    open('curves');
    curves.zoom(span);
  }, (name) => server.run('remove', {name}));
  const outcome = adoptionText(last, state);
  if (outcome) report(...outcome);
  if (last?.revision !== state.revision || (state.is_settled && !last?.is_settled)) {
    if (mark) where(mark);
    if (view === 'scatter') loadScatter();
    if (view === 'robot') loadRobot();
  }
  if (pending !== undefined && state.stage !== 'linear') {
    noted(bench.settled, pending);
    pending = undefined;
  }
};

/* Take the times and the error before, which a change of model or recordings makes others. */
const begin = async (since) => {
  curves.before = null;
  const {header, arrays} = await server.ask('curves');
  if (since !== server.state.fitted_since) return; // overtaken
  const {seconds, rest} = arrays;
  const time = Float64Array.from(seconds.values, (s, k) => s + rest.values[k]);
  curves.use(header.drives, time, arrays.segment.values, rowsOf(arrays.before));
  if (latest[0].length === time.length) curves.setNow(latest);
  bench.curves = curves;
  const options = (names, title = (name) => name) => names.map(
    (name) => make('option', title(name), '', {value: name}));
  $('brush-drive').replaceChildren(make('option', 'all drives', '', {value: ''}),
                                   ...options(header.drives));
  $('scatter-drive').replaceChildren(...options(header.drives));
  for (const [id, start] of [['scatter-x', 'velocity'], ['scatter-y', 'error now']]) {
    $(id).replaceChildren(...options(header.quantities, titleOf));
    $(id).value = start;
  }
  const [worst] = Object.entries(server.state.errors).sort((a, b) => b[1].before - a[1].before);
  if (worst) $('scatter-drive').value = worst[0];
  [$('from').value, $('to').value] = [time[0].toFixed(2), time[time.length - 1].toFixed(2)];
  setMark(null);
  if (wanted) {
    const {window: seen, mark: marked, axes, view: chosen} = wanted;
    wanted = null;
    const scatterOf = {x: 'scatter-x', y: 'scatter-y', drive: 'scatter-drive'};
    for (const [key, value] of Object.entries(axes)) {
      if ([...$(scatterOf[key]).options].some((option) => option.value === value)) {
        $(scatterOf[key]).value = value;
      }
    }
    if (seen) curves.zoom(seen);
    if (marked && (!marked.drive || header.drives.includes(marked.drive))) askAbout(marked);
    if (chosen) open(chosen);
  }
  afterPaint(() => { bench.first = performance.now(); });
};

/* -- marks -------------------------------------------------------------------------------- */

const setMark = (asked) => {
  mark = asked;
  tellAddress();
  curves.setSpans(null);
  curves.mark(asked?.time ?? null, asked?.drive);
  if (asked?.time) {
    [$('from').value, $('to').value] = asked.time.map((t) => t.toFixed(3));
    $('brush-drive').value = asked.drive || '';
  }
  if (!asked) {
    scatter.region = null;
    scatter.draw();
    showShares(null);
  }
};

const where = async (asked, began) => {
  let found;
  try {
    found = await server.ask('shares', asked);
  } catch (error) {
    report(error.message);
    return;
  }
  if (asked !== mark) return; // forgotten, or another one
  showShares(asked, found, (effect, at) => tick(effect, undefined, at), (spans) => {
    open('curves');
    const [a, b] = spans[0];
    const margin = Math.max(0.5, b - a);
    curves.setSpans(spans);
    curves.zoom([a - margin, b + margin]);
  }, unit(asked.drive));
  if (began !== undefined) noted(bench.shares, began);
};

const askAbout = (asked, began = performance.now()) => {
  setMark(asked);
  where(asked, began);
};

/* -- views -------------------------------------------------------------------------------- */

/* A link shows what is seen here; going back in the browser leaves the page as usual. */
const tellAddress = () => {
  if (wanted || !curves.before) return;
  history.replaceState(null, '', written({view, window: curves.window, mark, axes: {
    x: $('scatter-x').value, y: $('scatter-y').value, drive: $('scatter-drive').value}}));
};

const open = (name) => {
  view = name;
  tellAddress();
  for (const tab of tabs) {
    const chosen = tab.dataset.view === name;
    tab.setAttribute('aria-selected', String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    $(`view-${tab.dataset.view}`).hidden = !chosen;
  }
  robot.pause();
  $('play').setAttribute('aria-pressed', 'false');
  ({scatter: loadScatter, robot: loadRobot, recordings: () => showFiles(server),
    live: () => live.show(), curves: () => curves.resize()}[name] ?? (() => {}))();
};

const loadScatter = async () => {
  const [x, y, drive] = ['scatter-x', 'scatter-y', 'scatter-drive'].map((id) => $(id).value);
  if (!drive) return;
  const {arrays} = await server.ask(`scatter?${new URLSearchParams({x, y, drive})}`);
  const {region} = scatter;
  const same = scatter.names[0] === x && scatter.names[1] === y;
  scatter.use([x, y], arrays.x.values, arrays.y.values, drive);
  if (same && mark && !mark.time) {
    scatter.region = region;
    scatter.draw();
  }
};

const loadRobot = async () => {
  if (!server.state || server.state.is_empty) return;
  try {
    const {header, arrays} = await server.ask('robot');
    $('robot-time').max = arrays.time.values.length - 1;
    robot.use(header, arrays);
    if (curves.playhead !== null) robot.goTo(curves.playhead);
    $('robot-most').textContent = `0 to ${amount(robot.most)} ${unit()}`;
    robot.moved(robot.frame);
  } catch (error) {
    report(error.message);
  }
};

/* -- what there is ------------------------------------------------------------------------ */

const server = new Client(show, report);
const ticked = (began) => () => {
  if (began === undefined) return;
  noted(bench.latencies, began);
  pending = began;
};
const tick = (effect, drives, began) => server.change('tick', drives === undefined ? {effect}
  : drives.length ? {effect, drives} : {effect, is_ticked: false}, ticked(began));
const effects = new EffectList($('effect-list'), {
  tick, adopt: (effect) => server.change('adopt', {effect}),
  release: (effect) => server.change('release', {effect}),
  choose: (effect, key, value, began) => server.change('choose', {effect, key, value},
                                                       ticked(began))});
const curves = new Curves($('curves'), askAbout, unit);
const scatter = new Scatter($('scatter'), (region) => {
  mark = {x: $('scatter-x').value, y: $('scatter-y').value, drive: $('scatter-drive').value,
          ...region};
  curves.mark(null);
  where(mark, performance.now());
}, unit);
const robot = new Robot($('robot'), (frame) => {
  $('robot-time').value = frame;
  $('robot-clock').textContent = `${robot.time[frame].toFixed(2)} s`;
  curves.goTo(robot.time[frame]);
});
curves.moved = () => tellAddress();
curves.went = (time) => {
  curves.goTo(time);
  robot.goTo(time);
};
const live = new Live(server, () => view === 'live');
Object.assign(bench, {scatter, robot});

/* -- hands -------------------------------------------------------------------------------- */

const on = (id, event, work) => $(id).addEventListener(event, work);
const span = () => [Number($('from').value), Number($('to').value)];

for (const tab of tabs) {
  tab.setAttribute('aria-controls', `view-${tab.dataset.view}`);
  tab.id ||= `tab-${tab.dataset.view}`;
  tab.addEventListener('click', () => open(tab.dataset.view));
  tab.addEventListener('keydown', (event) => {
    const seen = seenTabs();
    const at = seen.indexOf(tab);
    const next = {ArrowLeft: seen.at(at - 1), ArrowRight: seen[(at + 1) % seen.length],
                  Home: seen[0], End: seen.at(-1)}[event.key];
    if (!next) return;
    event.preventDefault();
    open(next.dataset.view);
    next.focus();
  });
}
on('filter', 'input', () => effects.filter($('filter').value));
on('brush', 'submit', (event) => {
  event.preventDefault();
  askAbout({time: span(), drive: $('brush-drive').value || null}, event.timeStamp);
});
on('zoom', 'click', () => curves.zoom(span()));
on('all', 'click', () => curves.all());
for (const [kind, type, of] of [['svg', 'image/svg+xml', svgOf], ['csv', 'text/csv', csvOf]]) {
  on(`save-${kind}`, 'click', () => curves.before
    && save(`error.${kind}`, type, of(curves.seen(), curves.range())));
}
for (const id of ['scatter-x', 'scatter-y', 'scatter-drive']) {
  on(id, 'change', () => {
    setMark(null);
    loadScatter();
    tellAddress();
  });
}
on('play', 'click', () => {
  const plays = !robot.playing;
  $('play').setAttribute('aria-pressed', String(plays));
  if (plays) robot.play();
  else robot.pause();
});
on('robot-time', 'input', () => {
  robot.pause();
  robot.go(Number($('robot-time').value));
});
on('robot-error', 'change', () => {
  robot.what = $('robot-error').value;
  robot.draw();
});
// A link's own way would end in the browser's list of downloads, without the reason.
for (const link of document.querySelectorAll('a[download]')) {
  link.addEventListener('click', async (event) => {
    event.preventDefault();
    report('');
    try {
      const content = await server.file(link.href);
      save(link.download, content.type, content);
    } catch (error) {
      report(error.message);
    }
  });
}
for (const id of ['back', 'forward']) on(id, 'click', () => server.change(id, {}));
on('scheme', 'click', switchScheme);
on('design', 'click', () => server.run('experiment', {
  duration: Number($('experiment-duration').value)}));
on('invite', 'click', async () => report(
  `For one more browser, good once: ${(await server.ask('invite', {})).address}`, true));
const upload = async (files) => {
  for (const file of files) {
    try {
      server.take(await server.upload(file, {
        name: file.name, held_out: $('upload-held-out').checked ? '1' : '0'}));
      report('');
    } catch (error) {
      report(`${file.name}: ${error.message}`);
    }
  }
};
on('upload', 'change', async () => {
  await upload($('upload').files);
  $('upload').value = '';
});
document.addEventListener('dragover', (event) => {
  if (!event.dataTransfer.types.includes('Files')) return;
  event.preventDefault();
  document.body.classList.add('dropping');
});
document.addEventListener('dragleave', (event) => {
  if (!event.relatedTarget) document.body.classList.remove('dropping');
});
document.addEventListener('drop', (event) => {
  if (!event.dataTransfer.files.length) return;
  event.preventDefault();
  document.body.classList.remove('dropping');
  upload([...event.dataTransfer.files]);
});
on('help', 'click', () => $('keys').showModal());
on('close-keys', 'click', () => $('keys').close());
document.addEventListener('keydown', (event) => {
  const deed = (event.ctrlKey || event.metaKey) && !event.target.matches('input:not([type=checkbox])')
    && {z: event.shiftKey ? 'forward' : 'back', y: 'forward'}[event.key.toLowerCase()];
  if (deed && !$(deed).disabled) {
    event.preventDefault();
    server.change(deed, {});
    return;
  }
  if (event.target.matches('input:not([type=checkbox]), select') || event.ctrlKey
      || event.metaKey || event.altKey) return;
  const tab = seenTabs()[Number(event.key) - 1];
  if (event.key === '/') {
    event.preventDefault();
    $('filter').focus();
  } else if (event.key === 'Escape') setMark(null);
  else if (event.key === 'z' && mark?.time) curves.zoom(mark.time);
  else if (event.key === 'a') curves.all();
  else if (tab) open(tab.dataset.view);
});
document.addEventListener('pointerdown', (event) => {
  isPressed = Boolean(event.target.closest('button, a, label, [type=checkbox]'));
}, {capture: true});
for (const end of ['pointerup', 'pointercancel']) {
  document.addEventListener(end, () => setTimeout(() => { // the click comes first
    isPressed = false;
    const came = held;
    held = null;
    if (came) show(came.last, came.state, came.arrays);
  }), {capture: true});
}
whenDark(() => { if (server.state?.errors) showErrors($('errors'), server.state); });
drawScale($('robot-scale'));
followScheme();
wanted = read(location.hash, tabs.map((tab) => tab.dataset.view));
addEventListener('hashchange', () => location.reload());
const events = new EventSource('/api/events');
events.onmessage = (event) => server.hear(Number(event.data));
events.onerror = () => report('The workbench does not answer: was it stopped?');
events.onopen = () => report('');
