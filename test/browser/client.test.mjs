// SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {test} from 'node:test';

import {rowsOf, Client, unpack} from '../../pprs_dynamics/app/browser/client.mjs';

const packed = (header, values = []) => {
  const text = new TextEncoder().encode(JSON.stringify(header).padEnd(
    Math.ceil(JSON.stringify(header).length / 4) * 4));
  const buffer = new ArrayBuffer(4 + text.length + 4 * values.length);
  new DataView(buffer).setUint32(0, text.length, true);
  new Uint8Array(buffer).set(text, 4);
  new Float32Array(buffer, 4 + text.length).set(values);
  return buffer;
};

test('arrays are cut into rows', () => {
  const {header, arrays} = unpack(packed(
    {a: 1, arrays: [{name: 'x', shape: [1]}, {name: 'now', shape: [2, 3]}]}, [9, 1, 2, 3, 4, 5, 6]));
  assert.equal(header.a, 1);
  assert.deepEqual(rowsOf(arrays.now).map((row) => [...row]), [[1, 2, 3], [4, 5, 6]]);
});

const serve = (answers) => {
  const asked = [];
  globalThis.fetch = async (path, options) => {
    asked.push([path, options.body && JSON.parse(options.body)]);
    const {status = 200, header, text} = await answers.shift()();
    return {
      ok: status < 400, status, headers: new Map([['content-type', 'application/octet-stream']]),
      text: async () => text, arrayBuffer: async () => packed({arrays: [], ...header})};
  };
  return asked;
};

test('changes go out one after the other, each with the revision before it', async () => {
  const told = [];
  const server = new Client(() => {}, (text) => told.push(text));
  server.state = {revision: 1, version: 1, drawn: 'a'};
  const asked = serve([
    () => ({header: {revision: 2, version: 2, drawn: 'b'}}),
    () => ({header: {revision: 3, version: 3, drawn: 'c'}})]);
  server.change('tick', {effect: 'a'});
  await server.change('tick', {effect: 'b'});
  assert.deepEqual(asked.map(([, body]) => [body.effect, body.revision, body.drawn]),
                   [['a', 1, 'a'], ['b', 2, 'b']]);
  assert.equal(server.state.revision, 3);
  assert.deepEqual(told, ['', '']);
});

test('an answer that was overtaken is not shown', () => {
  const shown = [];
  const server = new Client((last, state) => shown.push(state.version), () => {});
  server.take({header: {version: 3}, arrays: {}});
  server.take({header: {version: 2}, arrays: {}});
  assert.deepEqual(shown, [3]);
});

test('a refusal is told, and the screen asked for', async () => {
  const told = [];
  const server = new Client(() => {}, (text) => told.push(text));
  server.state = {revision: 1, version: 1};
  const asked = serve([
    () => ({status: 409, text: '{"error": "something was changed elsewhere"}'}),
    () => ({header: {revision: 5, version: 2}})]);
  await server.change('tick', {effect: 'a'});
  await new Promise((done) => { setTimeout(done, 10); });
  assert.deepEqual(told, ['something was changed elsewhere']);
  assert.equal(asked[1][0], '/api/screen?drawn=');
  assert.equal(server.state.revision, 5);
});

test('a change that the answer to one of ours has already is not asked for', async () => {
  const server = new Client(() => {}, () => {});
  server.state = {revision: 1, version: 4};
  const asked = serve([() => ({header: {version: 5}})]);
  await server.hear(4);
  assert.deepEqual(asked, []);
  await server.hear(5);
  assert.equal(asked[0][0], '/api/screen?drawn=');
});
