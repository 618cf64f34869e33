/* Effects to tick: on which drives, with which values, and what speaks for them. */

import {button, make} from './dom.mjs';
import {digits, plain, titleOf} from './format.mjs';

const ABOUT = [['', 'equation'], ['Looks like: ', 'looks_like'], ['Caused by: ', 'causes'],
               ['Confirm: ', 'confirm']];

const EVIDENCE = 'evidence: 0 is the threshold, 10 are odds of 150 to 1';

/* A slider is a factor of ten either way, or as much as matters where there is a sign. */
export const fromSlider = (parameter, middle, at) => {
  const value = parameter.is_relative ? middle * 10 ** (at / 100)
    : middle + at / 100 * Math.max(Math.abs(middle), parameter.scale);
  return Math.min(parameter.upper, Math.max(parameter.lower, value));
};
export const toSlider = (parameter, middle) => (parameter.value === null ? 0 : Math.round(100 * (
  parameter.is_relative ? Math.log10(parameter.value / middle)
    : (parameter.value - middle) / Math.max(Math.abs(middle), parameter.scale))));

/* Whether the evidence supports an effect. Once there is a diagnosis, an effect that it does not
   report is supported only if it is ticked: the scan ignores how friction reverses. */
export const pays = (effect) => effect.evidence > 0
  && (effect.is_ticked || effect.is_called_for || !effect.is_judged);

/* What is ticked first, then what the diagnosis names, then by evidence. */
const score = (effect) => (effect.is_ticked ? 1e12 : 0) + (effect.is_called_for ? 1e11 : 0)
  + (effect.evidence ?? -1e9);
export const ordered = (effects) => [...effects].sort((a, b) => score(b) - score(a));

class EffectRow {
  constructor(effect, actions) {
    this.name = effect.name;
    this.actions = actions;
    this.node = make('li', '', 'effect');
    this.node.dataset.effect = effect.name;
    this.box = make('input', '', '', {type: 'checkbox', id: `tick-${effect.name}`});
    this.box.addEventListener('change', (event) => actions.tick(
      this.name, this.box.checked ? undefined : [], event.timeStamp));
    this.title = make('span');
    this.evidence = make('span', '', 'evidence');
    const label = make('label');
    label.append(this.box, this.title, this.evidence);
    const head = make('div', '', 'head');
    head.append(label);
    this.chips = make('div', '', 'chips');
    this.parameters = make('div');
    this.adopt = button('Adopt …', () => actions.adopt(this.name));
    this.adopt.title = 'Judge it on data that it was not fitted to';
    this.release = button('Best values', () => actions.release(this.name));
    this.bar = make('div', '', 'bar');
    this.bar.append(this.adopt, this.release);
    this.node.append(head, this.chips, this.parameters, this.bar);
    this.addAbout(head, effect);
    this.fields = new Map();
  }

  addAbout(head, effect) {
    const more = make('div', '', 'more', {hidden: true});
    more.append(...ABOUT.map(([what, key]) => make('p', what + effect[key])));
    const about = button('?', () => {
      more.hidden = !more.hidden;
      about.setAttribute('aria-expanded', String(!more.hidden));
    }, 'about');
    about.setAttribute('aria-label', `what is ${titleOf(effect.name)}?`);
    about.setAttribute('aria-expanded', 'false');
    head.append(about);
    this.node.append(more);
  }

  show(effect, state) {
    this.node.classList.toggle('ticked', effect.is_ticked);
    this.box.checked = effect.is_ticked;
    this.title.replaceChildren(titleOf(effect.name));
    if (effect.nonlinear) {
      this.title.append(make('abbr', ' ≈', '', {
        title: 'nonlinear: approximate until the model is evaluated'}));
    }
    if (effect.is_called_for) this.title.append(' ', make('span', 'reported', 'badge'));
    this.evidence.textContent = plain(effect.evidence);
    this.evidence.title = EVIDENCE + (effect.evidence > 0 && !pays(effect)
      ? '; a first estimate: the diagnosis does not report this effect'
      : '') + (effect.evidence_terms
      ? `; rise of the cost without it: ${effect.evidence_terms}` : '');
    this.evidence.classList.toggle('pays', pays(effect));
    this.evidence.classList.toggle('pending', effect.evidence_is_pending);
    this.evidence.setAttribute('aria-label', `evidence ${this.evidence.textContent}${
      effect.evidence_is_pending ? ', pending' : ''}`);
    this.bar.hidden = this.chips.hidden = this.parameters.hidden = !effect.is_ticked;
    if (!effect.is_ticked) return;
    this.adopt.disabled = Boolean(state.jobs.adopt?.is_running);
    this.release.hidden = !effect.parameters.some((parameter) => parameter.is_chosen);
    if (effect.is_on_drives) this.showDrives(effect.drives ?? [], state.drives);
    this.showParameters(effect.parameters);
  }

  showDrives(drives, places) {
    this.drives = drives;
    if (this.chips.children.length !== places.length) {
      this.chips.replaceChildren(...places.map((drive) => button(drive, (event) => {
        const on = new Set(this.drives);
        if (!on.delete(drive)) on.add(drive);
        this.actions.tick(this.name, [...on], event.timeStamp);
      }, 'chip')));
    }
    for (const chip of this.chips.children) {
      chip.setAttribute('aria-pressed', String(drives.includes(chip.textContent)));
    }
  }

  showParameters(parameters) {
    const keys = parameters.map((parameter) => parameter.key).join();
    if (this.keys !== keys) {
      this.keys = keys;
      this.fields.clear();
      this.parameters.replaceChildren(...parameters.map((parameter) => this.field(parameter)));
    }
    for (const parameter of parameters) {
      const {line, input, range, after} = this.fields.get(parameter.key);
      line.classList.toggle('chosen', parameter.is_chosen);
      if (document.activeElement !== input) {
        input.value = parameter.value === null ? '' : digits(parameter.value, parameter.std && 2 * parameter.std);
      }
      after.textContent = `${parameter.is_chosen ? '' : parameter.std === null ? '± … '
        : `± ${(2 * parameter.std).toPrecision(2)} `}${parameter.unit === '1' ? '' : parameter.unit}`;
      if (range && document.activeElement !== range) {
        if (!parameter.is_chosen) range.dataset.middle = parameter.value;
        range.value = toSlider(parameter, Number(range.dataset.middle ?? parameter.value));
      }
    }
  }

  field(parameter) {
    const line = make('div', '', 'parameter');
    const input = make('input', '', '', {type: 'number', step: 'any', id: `${this.name}-${parameter.key}`});
    const label = make('label', parameter.key, '', {htmlFor: input.id,
                                              title: `${parameter.symbol}: ${parameter.description}`});
    const after = make('span', '', 'quiet');
    line.append(label, input, after);
    input.addEventListener('change', (event) => {
      if (input.value !== '') {
        this.actions.choose(this.name, parameter.key, Number(input.value), event.timeStamp);
      }
    });
    let range;
    if (parameter.is_shape) {
      range = make('input', '', '', {type: 'range', min: -100, max: 100, step: 1});
      range.setAttribute('aria-label', `${titleOf(this.name)}, ${parameter.key}: drag its shape`);
      range.addEventListener('input', (event) => this.drag(parameter.key, fromSlider(
        parameter, Number(range.dataset.middle), Number(range.value)), event.timeStamp));
      line.append(range);
    }
    this.fields.set(parameter.key, {line, input, range, after});
    return line;
  }

  /* Only the last place of a drag goes out. */
  async drag(...wanted) {
    this.wanted = wanted;
    if (this.isDragging) return;
    this.isDragging = true;
    while (this.wanted) {
      const last = this.wanted;
      this.wanted = null;
      await this.actions.choose(this.name, ...last);
    }
    this.isDragging = false;
  }
}

/* The list. `actions` are tick(name, drives, began), where undefined drives are where it reduces
   the cost most and none at all unticks; adopt, release and choose. */
export class EffectList {
  constructor(root, actions) {
    Object.assign(this, {root, actions, rows: new Map(), order: '', text: ''});
  }

  show(state) {
    for (const effect of state.effects) {
      if (!this.rows.has(effect.name)) {
        this.rows.set(effect.name, new EffectRow(effect, this.actions));
      }
      this.rows.get(effect.name).show(effect, state);
    }
    // Rows stay where they are under a hand.
    const isBusy = this.root.matches(':hover') || this.root.contains(document.activeElement);
    const names = ordered(state.effects).map((effect) => effect.name);
    if (this.root.children.length !== names.length
        || (!isBusy && state.is_settled && names.join() !== this.order)) {
      this.order = names.join();
      this.root.replaceChildren(...names.map((name) => this.rows.get(name).node));
    }
    this.filter(this.text);
  }

  filter(text) {
    this.text = text.trim().toLowerCase().replaceAll(' ', '_');
    for (const row of this.rows.values()) {
      row.node.hidden = Boolean(this.text) && !row.name.includes(this.text) && !row.box.checked;
    }
  }
}
