// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {csvOf, svgOf, ticks, within} from '../../pprs_dynamics/app/browser/curve_files.mjs';

const time = Float64Array.from({length: 100001}, (_, k) => k / 1000);
const wave = (phase) => Array.from(time, (t) => Math.sin(t + phase));
const seen = [
  {drive: 'lift_1', unit: 'N', time, before: wave(0), now: wave(1).fill(null, 2200, 2300)},
  {drive: 'a<b', unit: 'N m', time, before: wave(2), now: Float32Array.from(wave(3))}];

test('what is seen begins and ends within the range', () => {
  assert.deepEqual(within(time, [2, 3]), [2000, 3001]);
  assert.deepEqual(within(time, [-5, 1e9]), [0, 100001]);
  assert.deepEqual(within(time, [2.0001, 2.0002]), [2001, 2001]);
});

test('ticks are round numbers within the range', () => {
  assert.deepEqual(ticks(0.03, 1.01, 5), [0.2, 0.4, 0.6, 0.8, 1]);
  assert.deepEqual(ticks(-2, 2, 4), [-2, -1, 0, 1, 2]);
  assert.equal(ticks(1e-9, 9e-9, 8).length, 9);
});

test('the CSV has the samples that are seen, and gaps are empty', () => {
  const [head, ...rows] = csvOf(seen, [2, 3]).trimEnd().split('\n');
  assert.equal(head, 'time [s],lift_1 error before [N],lift_1 error now [N],'
    + 'a<b error before [N m],a<b error now [N m]');
  assert.equal(rows.length, 1001);
  const cells = rows[250].split(',');
  assert.equal(+cells[0], 2.25);
  assert.ok(Math.abs(+cells[1] - Math.sin(2.25)) < 1e-8);
  assert.equal(cells[2], '');
  assert.ok(Math.abs(+cells[4] - Math.sin(5.25)) < 1e-6);
});

test('the SVG is of the range, has its peaks and titles, and is no larger than its pixels', () => {
  const svg = svgOf(seen, [0, 100]);
  assert.ok(svg.length < 400_000, svg.length);
  for (const said of ['time [s]', 'lift_1 [N]', 'a&lt;b [N m]', '>before<', '>now<']) {
    assert.ok(svg.includes(said), said);
  }
  assert.ok(!svg.includes('NaN'));
  // A peak of a single sample is drawn: the curve reaches the top of its panel there alone.
  const before = new Array(time.length).fill(0);
  before[50000] = 5;
  const peak = svgOf([{drive: 'd', unit: 'N', time, before, now: before}], [0, 100]);
  assert.ok(peak.includes('L519.0 46.0') || peak.includes('M519.0 46.0'), 'at the middle');
  const without = svgOf([{drive: 'd', unit: 'N', time, before, now: before}], [0, 40]);
  assert.ok(!/\d 46\.0[LM"]/.test(without));
});

test('a gap interrupts the line, and nothing at all is still a drawing', () => {
  const zoomed = svgOf(seen, [2.1, 2.4]);
  const lines = [...zoomed.matchAll(/ d="([^"]*)" fill="none" stroke="#0072b2"/g)];
  assert.equal(lines[0][1].split('M').length - 1, 2);
  assert.equal(lines[1][1].split('M').length - 1, 1);
  const gone = new Array(time.length).fill(null);
  assert.ok(!svgOf([{...seen[0], before: gone, now: gone}], [0, 1]).includes('NaN'));
});
