// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {cut, withGaps} from '../../pprs_dynamics/app/browser/curves.mjs';
import {fromSlider, ordered, pays, toSlider} from '../../pprs_dynamics/app/browser/effects.mjs';
import {rms, sentence} from '../../pprs_dynamics/app/browser/live.mjs';
import {adoptionText} from '../../pprs_dynamics/app/browser/panels.mjs';
import {heat} from '../../pprs_dynamics/app/browser/robot.mjs';
import {ticksOf, titled} from '../../pprs_dynamics/app/browser/scatter.mjs';
import {placeOf} from '../../pprs_dynamics/app/browser/shares.mjs';

test('no line goes over what was not measured, nor from one segment to the next', () => {
  const whole = Float32Array.of(1, 2, 3);
  assert.equal(withGaps(whole), whole);
  assert.deepEqual(withGaps(Float32Array.of(1, NaN, 3)), [1, null, 3]);
  assert.deepEqual(cut(whole, [0, 0, 1]), [1, 2, null]);
  assert.equal(cut(whole, null), whole);
});

test('a slider goes there and back, within the bounds', () => {
  const relative = {is_relative: true, lower: 0, upper: 5, scale: 1};
  assert.equal(fromSlider(relative, 0.1, 100), 1);
  assert.equal(fromSlider(relative, 1, 100), 5);
  const signed = {is_relative: false, lower: -1, upper: 1, scale: 0.2};
  for (const at of [-50, 0, 40]) {
    assert.equal(toSlider({...relative, value: fromSlider(relative, 0.1, at)}, 0.1), at);
    assert.equal(toSlider({...signed, value: fromSlider(signed, 0, at)}, 0), at);
  }
});

test('what is ticked comes first, then what is called for, then by evidence', () => {
  const effects = [{name: 'a', evidence: 5}, {name: 'b', evidence: null}, {name: 'c', evidence: 50},
                   {name: 'd', is_called_for: true, evidence: 1}, {name: 'e', is_ticked: true}];
  assert.deepEqual(ordered(effects).map((one) => one.name), ['e', 'd', 'c', 'a', 'b']);
});

test('beside a diagnosis only what it calls for, or what is ticked, is told to pay', () => {
  const slow = {name: 'time_delay', evidence: 118};
  assert.ok(pays({...slow, is_judged: false}));
  assert.ok(!pays({...slow, is_judged: true, is_called_for: false}));
  assert.ok(pays({...slow, is_judged: true, is_called_for: true}));
  assert.ok(pays({...slow, is_judged: true, is_ticked: true}));
  assert.ok(!pays({...slow, evidence: -1, is_called_for: true}));
});

test('an adoption is said once, at its end', () => {
  const state = (job, adoption) => ({jobs: {adopt: {number: 1, what: 'x_y', error: '', ...job}}, adoption});
  const adoption = {effect: 'x_y', adopted: true, reason: 'it fell'};
  const running = state({is_running: true}), ended = state({is_running: false}, adoption);
  assert.equal(adoptionText(null, {jobs: {}}), null);
  assert.equal(adoptionText(null, running), null);
  assert.deepEqual(adoptionText(running, ended), ['x y is adopted: it fell', true]);
  assert.equal(adoptionText(ended, ended), null);
  assert.match(adoptionText(running, state({is_cancelled: true}))[0], /called off/);
  assert.deepEqual(adoptionText(running, state({error: 'no'})), ['no', false]);
  // One that began and ended between two looks.
  assert.notEqual(adoptionText(ended, state({number: 2}, adoption)), null);
});

test('a live robot is told in its unit, and one that is silent as that', () => {
  assert.equal(rms([3, null, 4]), Math.sqrt(12.5));
  assert.equal(rms([null]), null);
  const found = {age: 0.1, error: [1], monitor_error: null, effects: ['payload_mass'], kept: 7,
                 trouble: '', received: 3};
  assert.equal(sentence(found, 'N m'),
               'error of the last 2 s 1.000 N m with payload mass · 7 s kept');
  assert.match(sentence({...found, age: 5}, 'N'), /^Nothing comes in .* any more/);
  assert.match(sentence({...found, age: null, received: 0}, 'N'), /joint_states\. $/);
});

test('axes have round numbers and units', () => {
  assert.deepEqual(ticksOf(0, 1, 5), [0, 0.2, 0.4, 0.6000000000000001, 0.8, 1]);
  const unitOf = (drive, quantity) => `${drive} ${quantity}`;
  assert.equal(titled('error now', 'turn', unitOf), 'error now [turn effort]');
  assert.equal(titled('velocity', 'turn', unitOf), 'velocity [turn velocity]');
  assert.equal(titled('time', 'turn', unitOf), 'time [s]');
});

test('colours and places', () => {
  assert.equal(heat(0), 'rgb(33,102,172)');
  assert.equal(heat(2), 'rgb(178,24,43)');
  assert.equal(placeOf({time: [1, 2.345], drive: null}), '1.00 to 2.35 s on all drives');
  assert.equal(placeOf({x: 'time', drive: 'lift_1'}), 'a region of lift_1');
});
