/* The part of a diagnosis's page on which effects are ticked: the workbench's, without a server. */

import {Curves} from './curves.mjs';
import {whenDark} from './dom.mjs';
import {EffectList} from './effects.mjs';
import {showErrors} from './errors.mjs';
import {amount, unitOf} from './format.mjs';
import {curveOf, errorOf, numbers, RidgeSystem, weightsOf} from './ridge.mjs';

const rms = (values, weights) => Math.sqrt(
  values.reduce((sum, value, k) => sum + weights[k] * value ** 2, 0)
  / weights.reduce((sum, weight) => sum + weight, 0));

export class WhatIf {
  constructor(data) {
    this.data = data;
    for (const name of ['gram', 'side']) data[name] = numbers(data[name], Float64Array);
    this.system = new RidgeSystem(data);
    for (const drive of data.drives) {
      drive.time = Float64Array.from(numbers(drive.time, Float32Array));
      drive.rows = numbers(drive.rows, Int16Array);
      drive.scales = numbers(drive.scales, Float64Array);
      drive.products = numbers(drive.products, Float64Array);
      drive.points = drive.time.length;
    }
    this.asFound();
  }

  asFound() {
    this.ticked = new Set(this.data.effects.flatMap((effect) => effect.placements.filter(
      (one) => one.is_found)));
  }

  /* Put an effect on some drives, or where it explains most without any named. */
  tick(name, drives) {
    const {placements} = this.data.effects.find((one) => one.name === name);
    for (const one of placements) {
      const isOn = drives ? drives.includes(one.drive) : one.is_first_choice;
      this.ticked[isOn ? 'add' : 'delete'](one);
    }
  }

  /* What the workbench's server answers, and curves of what is left. */
  state() {
    const {effects, drives, gap} = this.data;
    const chosen = effects.flatMap(({placements}) => placements).filter(
      (one) => this.ticked.has(one));
    const {c, cost} = this.system.fit(chosen);
    const own = (effect) => effect.placements.filter((one) => this.ticked.has(one));
    const evidence = new Map();
    for (const effect of effects.filter((one) => !own(one).length)) {
      const more = effect.placements.filter((one) => one.is_first_choice);
      evidence.set(effect, cost - this.system.fit([...chosen, ...more]).cost);
    }
    // From the last one on the factor stays good for what stands before.
    for (const effect of effects.filter((one) => own(one).length).reverse()) {
      const mine = own(effect);
      evidence.set(effect, this.system.fit(chosen.filter((one) => !mine.includes(one))).cost - cost);
    }
    const errors = drives.map((drive) => ({
      before: drive.given, now: errorOf(drive, c), noise: drive.noise}));
    const samples = drives.map((one) => one.samples);
    const isApproximate = effects.some((effect) => effect.is_approximate && effect.placements.some(
      (one) => one.is_found !== this.ticked.has(one)));
    return {
      drives: drives.map((one) => one.name), units: this.data.units, unit: this.data.unit,
      is_settled: true, is_approximate: isApproximate,
      errors: Object.fromEntries(drives.map(({name}, d) => [name, errors[d]])),
      overall: {before: rms(errors.map((one) => one.before), samples),
                now: rms(errors.map((one) => one.now), samples)},
      effects: effects.map((effect) => ({
        name: effect.name, is_ticked: own(effect).length > 0,
        drives: own(effect).map((one) => one.drive),
        places: effect.placements.map((one) => one.drive),
        is_on_drives: effect.placements[0].drive !== null, evidence: evidence.get(effect),
        evidence_is_pending: false, nonlinear: effect.is_approximate,
        is_called_for: effect.placements.some((one) => one.is_found), parameters: []})),
      now: drives.map((drive) => curveOf(drive, weightsOf(drive, c), gap))};
  }

  before() {
    const {drives, gap} = this.data;
    return drives.map((drive) => curveOf(drive, [...drive.columns.map(() => 0), 0, 1], gap));
  }
}

const begin = async (part) => {
  const whatIf = new WhatIf(JSON.parse(document.getElementById('what-if-data').textContent));
  const {drives} = whatIf.data;
  const find = (place) => part.querySelector(place);
  const list = new EffectList(find('.effect-list'), {tick: (name, on) => {
    whatIf.tick(name, on);
    update();
  }});
  await window.library('uplot');
  const curves = new Curves(find('.curves'), ({time}) => {
    curves.mark(null);
    curves.zoom(time);
  }, (drive) => unitOf(whatIf.data, drive));
  curves.use(drives.map((one) => one.name), drives.map((one) => one.time), null, whatIf.before(),
             drives.map((one) => one.noise));
  const update = () => {
    const state = whatIf.state();
    window.whatIf.state = state;
    const names = state.effects.filter((one) => one.is_ticked).map((one) => one.name);
    find('[role=status]').textContent = `With ${names.join(', ') || 'nothing'} in the model the `
      + `error would be ${state.is_approximate ? '≈ ' : ''}${amount(state.overall.now)} ${
        state.unit}, as given it is ${amount(state.overall.before)} ${state.unit}.`;
    showErrors(find('.error-tiles'), state);
    list.show(state);
    curves.setNow(state.now);
  };
  find('button').addEventListener('click', () => {
    whatIf.asFound();
    update();
  });
  window.whatIf = {curves};
  whenDark(update);
  update();
  part.dataset.ready = '';
};

export const prepare = () => {
  const part = document.getElementById('what-if');
  const fold = part.closest('details');
  if (fold.open) begin(part); // by somebody who was faster than the page
  else fold.addEventListener('toggle', () => begin(part), {once: true});
};
