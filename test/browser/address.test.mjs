// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {read, written} from '../../pprs_dynamics/app/browser/address.mjs';

const VIEWS = ['curves', 'scatter', 'robot'];

test('what is written is what is read', () => {
  const seen = {view: 'scatter', window: [1.5, 20], mark: {time: [2, 3.25], drive: 'lift_1'},
                axes: {x: 'velocity', y: 'error now', drive: 'slide_2'}};
  assert.deepEqual(read(written(seen), VIEWS), seen);
  const all = {view: 'curves', window: null, mark: {time: [0, 1], drive: null}, axes: {}};
  assert.deepEqual(read(written(all), VIEWS), all);
});

test('a region of a scatter has no time, and is left out', () => {
  assert.equal(read(written({view: 'scatter', mark: {x: 'velocity', y: 'time'}}), VIEWS).mark, null);
});

test('an address that somebody mistyped shows the page as ever', () => {
  for (const hash of ['', '#', '#view=nothing&window=3~1&mark=a~b', '#window=1~2~3', '#window=~',
                      '#window=1~Infinity']) {
    assert.deepEqual(read(hash, VIEWS), {view: null, window: null, mark: null, axes: {}});
  }
});
