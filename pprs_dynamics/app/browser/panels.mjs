/* Panels around the views: the verdict, the ledger, recordings, the next experiment. */

import {$, button, make} from './dom.mjs';
import {amount, plain, titleOf} from './format.mjs';

const VERDICTS = {adequate: 'the model is adequate', effect: 'effects are missing or have other values',
                  ambiguous: 'several effects explain the error alike',
                  unknown: 'an error remains that no effect explains'};
/* The same, since a reference run. */
const CHANGES = {adequate: 'nothing has changed', effect: 'the reported effects have changed',
                 ambiguous: 'several effects explain alike what has changed',
                 unknown: 'something has changed that no effect explains'};

const fall = (before, now, state) => `${amount(before)} → ${amount(now)} ${state.unit}`;

const doing = (job) => ({diagnose: 'diagnosing', adopt: `judging ${titleOf(job.what)}`,
                         experiment: 'designing'}[job.kind]);

const jobLine = (job, cancel) => {
  const bar = make('progress', '', '', {max: 1});
  bar.setAttribute('aria-label', doing(job));
  const stop = button('Cancel', () => cancel(job.kind));
  stop.setAttribute('aria-label', `Cancel ${doing(job)}`);
  const line = make('span', '', 'job', {id: `job-${job.number}`});
  line.append(` · ${doing(job)} `, bar, ' ', stop);
  return line;
};

/* The elements of each job stay: a button that is replaced while it is pressed is never clicked. */
export const showJobs = (jobs, cancel) => {
  const running = jobs.filter((job) => job.is_running);
  for (const line of document.querySelectorAll('#jobs .job')) {
    if (!running.some((job) => line.id === `job-${job.number}`)) line.remove();
  }
  for (const job of running) {
    if (!$(`job-${job.number}`)) $('jobs').append(jobLine(job, cancel));
    $(`job-${job.number}`).querySelector('progress').value = job.share;
  }
};

export const showVerdict = (state) => {
  const {before, now, noise} = state.overall, {reference} = state;
  const line = make('span');
  if (state.little) line.append(make('b', `${state.little} · `));
  const since = reference ? `since ${reference.recordings.join(', ')} ` : '';
  line.append(`error ${since}`, make('b', fall(before, now, state)), ` · noise ${amount(noise)} ${
    noise === null ? '' : state.unit}`);
  if (state.verdict) {
    line.append(` · diagnosis: ${(reference ? CHANGES : VERDICTS)[state.verdict]}`);
  }
  $('verdict').replaceChildren(line);
  $('reference').hidden = !reference;
  $('reference').textContent = reference ? `${reference.text.join('; ')}.` : '';
};

/* What an adoption came to, once: [sentence, whether it is good]. */
export const adoptionText = (last, state) => {
  const job = state.jobs?.adopt;
  if (!job || job.is_running || job.number === last?.jobs?.adopt?.number
      && !last.jobs.adopt.is_running) return null;
  if (job.error) return [job.error, false];
  if (job.is_cancelled) return [`${titleOf(job.what)} was called off: nothing changed.`, false];
  const {effect, adopted, reason} = state.adoption;
  return [`${titleOf(effect)} is ${adopted ? 'adopted' : 'refused'}: ${reason}`, adopted];
};

export const showStage = (state) => {
  const words = {linear: 'noise and shapes are being fitted …',
                 fitted: state.is_settled ? '' : 'shapes are being fitted …',
                 refined: 'the model is being evaluated …', exact: ''}[state.stage];
  $('stage').replaceChildren(state.is_approximate ? `≈ approximate: ${words}` : words);
  if (state.departure > 0.005) {
    $('stage').append(make('span', ` Values of yours cost ${state.departure.toFixed(
      state.departure < 10 ? 1 : 0)} against the best (10 are odds of 150 to 1).`, 'departure'));
  }
  if (state.notice) $('stage').append(` ${state.notice}`);
  $('export-ticked').hidden = !state.effects.some((effect) => effect.is_ticked);
};

export const showLedger = (state) => {
  const start = make('li');
  const first = state.steps[0];
  start.append(make('b', 'model'),
               make('div', first ? `${amount(first.error_before)} ${state.unit}` : ''));
  $('ledger').replaceChildren(start, ...state.steps.map((step) => {
    const item = make('li');
    item.append(make('b', titleOf(step.effect)), step.drives ? ` on ${step.drives.join(', ')}` : '',
                make('div', fall(step.error_before, step.error_after, state)),
                make('div', `held out ${fall(step.held_out_before, step.held_out_after, state)}`,
                     'quiet'));
    item.title = `${step.date}, held out on ${step.held_out_on}${step.forced ? ', forced' : ''}`;
    return item;
  }));
  for (const [id, verb, deed] of [['back', 'Undo', state.undoes], ['forward', 'Redo',
                                                                   state.redoes]]) {
    $(id).disabled = !deed;
    $(id).title = deed ? `${verb}: ${deed}` : '';
  }
};

export const showRecordings = (state, see, remove) => {
  const without = (recording) => {
    const gone = button('×', () => remove(recording.key), 'gone');
    gone.setAttribute('aria-label', `Remove ${recording.name}`);
    gone.title = 'Remove this recording from the session';
    return gone;
  };
  $('strip').replaceChildren(...state.recordings.map((recording) => {
    const item = make('li');
    const place = button('', () => see([recording.start, recording.end]));
    place.append(make('b', recording.name), make('div', fall(recording.before, recording.now, state)),
                 make('div', `${(recording.end - recording.start).toFixed(1)} s`, 'quiet'));
    item.append(place);
    if (state.recordings.length > 1) item.append(without(recording));
    return item;
  }), ...state.held_out.map((recording) => {
    const item = make('li'), place = make('div', '', 'held-out');
    place.append(make('b', recording.name), make('div', 'held out', 'quiet'));
    item.append(place, without(recording));
    return item;
  }));
  $('held-out').textContent = state.held_out.length
    ? `Adoptions are checked on ${state.held_out.map((recording) => recording.name).join(', ')}.`
    : 'Adoptions are checked on blocks of the same recordings, which is weak evidence. Add a '
      + 'recording of another motion as held out.';
  const findings = state.recordings.flatMap((recording) => recording.findings.map(
    (text) => make('li', `${recording.name}: ${text}`)));
  $('findings').replaceChildren(...(findings.length ? findings : [make('li', 'none', 'quiet')]));
};

export const showExperiment = (state) => {
  const found = state.experiment;
  const job = state.jobs.experiment;
  $('experiment-file').hidden = !found;
  $('design').disabled = Boolean(job?.is_running);
  $('experiment-text').textContent = job?.is_running ? `designing … ${
    (100 * job.share).toFixed(0)} %` : job?.error || found?.text || '';
  $('experiment-table').hidden = !found?.contests.length;
  $('experiment-table').tBodies[0].replaceChildren(...(found?.contests ?? []).map((contest) => {
    const row = make('tr');
    row.append(...[titleOf(contest.truth), titleOf(contest.rival), plain(contest.evidence_now),
                   plain(contest.expected_evidence)].map((text) => make('td', text)));
    return row;
  }));
};

export const showFiles = async (server) => {
  if (!server.state?.has_folders) return;
  $('folders').hidden = false;
  const {files} = await server.ask('files');
  $('files').replaceChildren(...files.map((name) => {
    const item = make('li', '', 'bar');
    const judge = button('Hold out', () => server.run('open', {name, is_held_out: true}));
    judge.disabled = Boolean(server.state.is_empty);
    item.append(make('span', name.slice(name.indexOf('/') + 1)), button('Open', () => server.run('open', {name})), judge);
    return item;
  }));
};
