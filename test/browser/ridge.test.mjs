// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {curveOf, errorOf, numbers, RidgeSystem, weightsOf} from '../../pprs_dynamics/app/browser/ridge.mjs';

const near = (found, wanted) => assert.ok(
  Math.abs(found - wanted) <= 1e-9 * (1 + Math.abs(wanted)), `${found} is not ${wanted}`);

// By Cramer's rule: [[4, 1, .5], [1, 3, .2], [.5, .2, 2]] c = [1, 2, 3].
const data = () => ({
  gram: Float64Array.of(4, 1, 0.5, 1, 3, 0.2, 0.5, 0.2, 2), side: Float64Array.of(1, 2, 3),
  always: [0], limited: [], deviations: 2, steepness: 100, name_prior_cost: 5, wrong_sign_odds: 0.01,
  drive_prior_costs: [3, 4], effects: []});
const placement = (columns, more = {}) => ({
  columns, fixed: [], signs: [], prior_cost: 0, hypotheses: [], drive: null, ...more});
const solve2 = ([[a, b], [, d]], [p, q]) => [(p * d - b * q) / (a * d - b * b),
                                             (a * q - b * p) / (a * d - b * b)];

test('the fit of a subset solves its equations, in whatever order sets follow each other', () => {
  const system = new RidgeSystem(data());
  const [one, two] = [placement([1]), placement([2])];
  for (let turn = 0; turn < 2; turn++) {
    near(system.fit([]).c[0], 1 / 4);
    const [x, y] = solve2([[4, 1], [1, 3]], [1, 2]);
    const {c, cost} = system.fit([one]);
    near(c[0], x);
    near(c[1], y);
    assert.equal(c[2], 0);
    // c' A c - 2 b' c + ln det A
    near(cost, -(x + 2 * y) + Math.log(11));
    near(system.fit([two]).c[2], solve2([[4, 0.5], [0.5, 2]], [1, 3])[1]);
    near(system.fit([one, two]).c[0] * 4 + system.fit([one, two]).c[1]
         + 0.5 * system.fit([one, two]).c[2], 1);
  }
});

test('a fixed column takes part with the coefficient 1', () => {
  const {c} = new RidgeSystem(data()).fit([placement([], {fixed: [2]})]);
  assert.equal(c[2], 1);
  near(c[0], (1 - 0.5) / 4);
});

test('a number beyond its tolerance is drawn back, steeply', () => {
  const free = new RidgeSystem({...data(), side: Float64Array.of(40, 2, 3)}).fit([]);
  near(free.c[0], 10);
  const held = new RidgeSystem({...data(), side: Float64Array.of(40, 2, 3), limited: [0]}).fit([]);
  // (4 + 100) c = 40 + 100 * 2
  near(held.c[0], 240 / 104);
});

test('the cost of a number near its tolerance is the integral over it', () => {
  const system = (side) => new RidgeSystem({...data(), side: Float64Array.of(side, 2, 3),
                                            limited: [0]});
  for (const side of [0, 3, 7.9, 8.1, 9, 12, 40]) {
    let sum = 0;
    const step = 1e-4;
    for (let x = -12; x < 12; x += step) {
      const cost = 4 * x * x - 2 * side * x + 100 * Math.max(Math.abs(x) - 2, 0) ** 2;
      sum += step * Math.exp(-cost / 2);
    }
    const wanted = -2 * Math.log(sum / Math.sqrt(2 * Math.PI));
    // But for what lies beyond the other limit.
    assert.ok(Math.abs(system(side).fit([]).cost - wanted) < 2e-4, `${side}`);
  }
});

test('names, drives and unphysical signs are priced', () => {
  const effect = {placements: [
    placement([1], {prior_cost: 0.5, hypotheses: ['h'], drive: 'a', signs: [[1, 10], [0, -10]]}),
    placement([2], {prior_cost: 0.25, hypotheses: ['h', 'g'], drive: 'b'})]};
  const priced = new RidgeSystem({...data(), effects: [effect]});
  const bare = new RidgeSystem(data());
  const strip = (one) => placement(one.columns);
  const priorCost = (used) => priced.fit(used).cost - bare.fit(used.map(strip)).cost;
  // Of four choices of two signs one has the odds of 99 : 1, the others share the rest.
  const wrong = 2 * Math.log(99 * 3);
  near(priorCost([effect.placements[0]]), 0.5 + wrong + 5 + 3);
  near(priorCost(effect.placements), 0.75 + wrong + 2 * 5 + 4);
});

test('what is left of a drive is a sum of squares, and a curve', () => {
  const columns = [0, 2];
  // Columns (1, 0, 1) and (0, 2, 0), error (3, 2, 1).
  const drive = {columns, samples: 3, points: 3, scales: [1, 0.5, 1, 2],
                 products: Float64Array.of(2, 0, 4, 0, 4, 4, 4, 4, 14),
                 rows: Int16Array.of(1, 0, 1, 0, 4, 0, 3, 2, -9, 1, 1, 1)};
  const c = Float64Array.of(1, 7, 0.5);
  near(errorOf(drive, c), Math.sqrt((4 + 1 + 0) / 3));
  assert.deepEqual([...curveOf(drive, weightsOf(drive, c), -9)], [2, 1, NaN]);
  assert.deepEqual([...curveOf(drive, [0, 0, 0, 1], -9)], [2, 2, 2]);
});

test('numbers come as letters', () => {
  const letters = btoa(String.fromCharCode(...new Uint8Array(Float64Array.of(1.5, -2).buffer)));
  assert.deepEqual([...numbers(letters, Float64Array)], [1.5, -2]);
});
