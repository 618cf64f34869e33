/* Joint states of a running robot, and what the model makes of them. */

import {$, css, make} from './dom.mjs';
import {amount, titleOf, unitOf} from './format.mjs';

const PERIOD = 400; // [ms] between looks
const LATE = 2; // [s] without a message, from which nothing comes in any more

export const rms = (values) => {
  const known = (values ?? []).filter((v) => v !== null);
  return known.length ? Math.sqrt(known.reduce((a, v) => a + v * v, 0) / known.length) : null;
};

export const sentence = (found, unit) => {
  if (found.age === null || found.age >= LATE) {
    return `Nothing comes in on joint_states${found.received ? ' any more' : ''}. ${found.trouble}`;
  }
  return [
    `error of the last 2 s ${amount(rms(found.error))} ${unit} with ${
      found.effects.map(titleOf).join(', ') || 'no added effect'}`,
    found.monitor_error && `the monitor reports ${amount(rms(found.monitor_error))} ${unit}`,
    `${found.kept.toFixed(0)} s kept`, found.trouble].filter(Boolean).join(' · ');
};

/* Sentences of the monitor's live diagnosis; `null` without one. */
export const changesSaid = (diagnosis) => {
  if (!diagnosis) return '';
  const gone = (diagnosis.withdrawn ?? []).map((effect) => titleOf(effect.name)).join(', ');
  return [diagnosis.text ? `What changed: ${diagnosis.text}` : 'Nothing has changed.',
          gone && `Gone: ${gone}.`, diagnosis.note].filter(Boolean).join(' ');
};

export class Live {
  constructor(server, isSeen) {
    Object.assign(this, {server, isSeen, plots: []});
    setInterval(() => this.show(), PERIOD);
    $('live-set').addEventListener('click', () => this.ask(
      'live/set', 'Set the ticked effects on this machine?', 'Set'));
    $('live-restore').addEventListener('click', () => this.ask(
      'live/restore', 'Restore the previous model of this machine?', 'Restore'));
    $('live-no').addEventListener('click', () => $('live-confirm').close());
    $('live-yes').addEventListener('click', () => this.set());
    $('live-pause').addEventListener('click', () => { // what comes in meanwhile is kept
      this.isPaused = !this.isPaused;
      $('live-pause').setAttribute('aria-pressed', String(this.isPaused));
    });
    $('live-take').addEventListener('click', () => server.run(
      'live/take', {}, 'The last live data are now a recording of this session.'));
  }

  /* A person confirms the machine by its name: the robot that moves may not be the one meant. */
  async ask(change, question, verb) {
    try {
      const {machine} = await this.server.ask('live/machine');
      if (!machine) {
        this.server.report('No node that could be set is running.');
        return;
      }
      this.asked = {change, machine};
      $('live-question').textContent = question;
      $('live-machine').textContent = machine;
      $('live-yes').textContent = verb;
      $('live-confirm').showModal();
    } catch (error) {
      this.server.report(error.message);
    }
  }

  async set() {
    const {change, machine} = this.asked;
    $('live-confirm').close();
    try {
      const {nodes, is_set: isSet} = await this.server.ask(change, {confirmed: machine});
      const took = change === 'live/set' ? 'took the effects' : 'has what it had';
      $('live-nodes').replaceChildren(...Object.entries(nodes).map(([name, reason]) =>
        make('li', `${name}: ${reason || took}`)));
      this.server.report(isSet ? '' : 'Nothing was set: the node refused.');
    } catch (error) {
      this.server.report(error.message);
    }
  }

  async show() {
    const {state} = this.server;
    if (!this.isSeen() || !state?.has_live || this.isPaused) return;
    let found;
    try {
      found = await this.server.ask('live');
    } catch (error) {
      $('live-state').textContent = error.message;
      return;
    }
    this.found = found;
    $('live-state').textContent = sentence(found, unitOf(state));
    $('live-changes').textContent = changesSaid(found.diagnosis);
    $('live-changes').classList.toggle('changed', Boolean(found.diagnosis?.confirmed));
    $('live-take').disabled = !found.kept;
    $('live-restore').disabled = !found.can_restore;
    if (!found.residual.length) return;
    const time = found.time.map((t) => t - found.time[found.time.length - 1]);
    if (this.plots.length !== found.drives.length) this.build(found.drives, time, found.residual);
    this.plots.forEach(({plot, reading}, d) => {
      plot.setData([time, found.residual[d]]);
      reading.textContent = `${amount(found.error[d])} ${unitOf(state, found.drives[d])}`;
    });
  }

  build(drives, time, residual) {
    const root = $('live-curves');
    root.replaceChildren();
    const axis = {stroke: css('--quiet'), grid: {stroke: css('--line'), width: 1},
                  font: '12px system-ui'};
    this.plots = drives.map((drive, d) => {
      const box = make('div', '', 'curve'), head = make('h3', drive), reading = make('span');
      head.append(reading);
      box.append(head);
      root.append(box);
      const unit = unitOf(this.server.state, drive);
      return {reading, plot: new uPlot({
        width: Math.max(root.clientWidth, 100), height: 94, legend: {show: false},
        padding: [8, 6, 0, 0], cursor: {show: false}, scales: {x: {time: false}},
        axes: [{...axis, size: 30, values: (u, ticks) => ticks.map((t) => `${t} s`)},
               {...axis, size: 62, space: 22,
                values: (u, ticks) => ticks.map((t) => `${+t.toPrecision(3)} ${unit}`)}],
        series: [{}, {stroke: css('--now'), width: 1, points: {show: false}}],
      }, [time, residual[d]], box)};
    });
  }
}
