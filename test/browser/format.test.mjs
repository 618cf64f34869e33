// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {amount, change, digits, plain, signed, unitOf} from '../../pprs_dynamics/app/browser/format.mjs';

test('a value has the digits that its uncertainty allows', () => {
  assert.equal(digits(0.149773, 0.0010), '0.1498');
  assert.equal(digits(123.456, 20), '123');
  assert.equal(digits(1.23456789, null), '1.2346');
  assert.equal(digits(null, 1), '–');
  assert.equal(digits(1, 1e-300), '1.000000000000');
});

test('numbers that are not known are no numbers', () => {
  for (const one of [null, undefined, NaN]) {
    assert.equal(amount(one), '–');
    assert.equal(signed(one), '–');
    assert.equal(plain(one), '…');
  }
  assert.equal(amount(0.0364), '0.036');
  assert.equal(amount(12.34), '12.3');
  assert.equal(signed(-0.5), '−0.500');
});

test('evidence is short where it is large, and a fall has its sign', () => {
  assert.equal(plain(-36.4), '−36');
  assert.equal(plain(172635), '173 k');
  assert.equal(plain(-31218), '−31 k');
  assert.equal(change(0.492, 0.036), '−93 %');
  assert.equal(change(1, 1.2), '+20 %');
  assert.equal(change(1, 1.004), '');
  assert.equal(change(0, 1), '');
});

test('a drive has its own unit, all together theirs', () => {
  const state = {unit: 'N or N m', units: {turn: {effort: 'N m', velocity: 'rad/s'}}};
  assert.equal(unitOf(state, 'turn'), 'N m');
  assert.equal(unitOf(state, 'turn', 'velocity'), 'rad/s');
  assert.equal(unitOf(state), 'N or N m');
  assert.equal(unitOf(null), '');
});
