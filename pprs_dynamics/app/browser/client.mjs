/* Asking the workbench's server, and what is known of its state. */

/* A header and named arrays, as `wire.py` writes them. */
export const unpack = (buffer) => {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  const arrays = {};
  for (const {name, shape} of header.arrays) {
    const size = shape.reduce((a, b) => a * b, 1);
    arrays[name] = {values: new Float32Array(buffer, at, size), shape};
    at += 4 * size;
  }
  return {header, arrays};
};

export const rowsOf = ({values, shape}) => Array.from({length: shape[0]}, (_, k) =>
  values.subarray(k * shape[1], (k + 1) * shape[1]));

const answered = async (url, options) => {
  const response = await fetch(url, options);
  if (!response.ok) {
    const text = await response.text();
    let sentence = text || `${response.status}`;
    try {
      sentence = JSON.parse(text).error;
    } catch { /* it is the sentence itself */ }
    throw Object.assign(new Error(sentence), {status: response.status});
  }
  return response;
};

const request = async (path, options) => {
  const response = await answered(`/api/${path}`, options);
  return response.headers.get('content-type').includes('octet-stream')
    ? unpack(await response.arrayBuffer()) : response.json();
};

export class Client {
  /* `show` is called with the state before, the state now and arrays that changed; `report` with
     what goes wrong. */
  constructor(show, report) {
    Object.assign(this, {show, report, state: null, heard: 0, underway: 0, isRefreshing: false});
    this.chain = Promise.resolve(); // changes go out one after the other
  }

  ask(path, body) {
    return request(path, body === undefined ? {} : {
      method: 'POST', headers: {'Content-Type': 'application/json'},
      body: JSON.stringify({...body, drawn: this.state?.drawn ?? ''})});
  }

  upload(file, query) {
    return request(`upload?${new URLSearchParams({...query, drawn: this.state?.drawn ?? ''})}`,
                   {method: 'POST', body: file});
  }

  /* What is at an address of the server, as a file. */
  async file(url) {
    return (await answered(url)).blob();
  }

  take({header, arrays}) {
    const last = this.state;
    // An answer that was overtaken by a later one holds nothing new.
    if (last && header.version < last.version) return;
    this.state = header;
    this.show(last, this.state, arrays);
  }

  /* Ask for what is no change of the model, and show what follows. */
  async run(path, body = {}, text = '') {
    this.report('');
    try {
      const found = await this.ask(path, body);
      // The result of the work may have been reported already.
      if (text) this.report(text, true);
      this.take(found);
    } catch (error) {
      this.report(error.message);
    }
  }

  /* Each change has the revision that the one before led to. */
  change(path, body, answered = () => {}) {
    this.underway += 1;
    this.chain = this.chain.then(async () => {
      try {
        const found = await this.ask(path, {...body, revision: this.state.revision});
        this.report('');
        answered();
        this.take(found);
      } catch (error) {
        this.report(error.message);
        this.heard = Infinity;
      }
      this.underway -= 1;
      this.refresh();
    });
    return this.chain;
  }

  /* The server sent its version, which an answer to a change of ours may have as well. */
  hear(version) {
    this.heard = Math.max(this.heard, version);
    return this.refresh();
  }

  async refresh() {
    if (this.isRefreshing) return;
    this.isRefreshing = true;
    while (!this.underway && (!this.state || this.heard > this.state.version)) {
      try {
        const found = await this.ask(`screen?${new URLSearchParams({drawn: this.state?.drawn ?? ''})}`);
        if (this.heard === Infinity) this.heard = found.header.version;
        this.take(found);
      } catch (error) {
        this.report(error.status ? error.message
          : 'The workbench does not answer: was it stopped?');
        break;
      }
    }
    this.isRefreshing = false;
  }
}
