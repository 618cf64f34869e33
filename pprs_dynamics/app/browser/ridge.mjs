/* What-if fits of a diagnosis: a small ridge system, solved for the effects that are ticked. */

const MOST_ROUNDS = 12; // until the numbers at their limits are known

/* Numbers from the letters of base64. */
export const numbers = (letters, Kind) => new Kind(
  Uint8Array.from(atob(letters), (one) => one.charCodeAt(0)).buffer);

export class RidgeSystem {
  /* `data` as `what_if_part.py` writes it, its matrices as arrays. */
  constructor(data) {
    this.data = data;
    this.limited = new Set(data.limited);
    this.size = data.side.length;
    this.L = new Float64Array(this.size * this.size); // the factor
    this.factored = []; // of these columns
    this.held = [];
    this.beyond = data.always.map(() => 0); // signs of numbers beyond their limits
  }

  /* Coefficients of a set of placements and the cost of the set, as `NormalEquations.solve`. */
  fit(placements) {
    const {always, side, deviations, steepness} = this.data;
    const free = [...always, ...placements.flatMap((one) => one.columns)];
    const fixed = placements.flatMap((one) => one.fixed);
    const c = new Float64Array(this.size);
    for (const k of fixed) c[k] = 1;
    let logDet = 0;
    for (let round = 0; round < MOST_ROUNDS; round++) {
      this.factor(free);
      logDet = this.solve(free, fixed, c);
      this.beyond = always.map((k) => (this.limited.has(k) && Math.abs(c[k]) > deviations
        ? Math.sign(c[k]) : 0));
      if (this.beyond.every((sign, i) => sign === this.held[i])) break;
    }
    const {gram} = this.data;
    let cost = logDet + this.price(placements, c);
    const all = [...free, ...fixed];
    for (const i of all) {
      cost -= 2 * side[i] * c[i];
      for (const j of all) cost += c[i] * c[j] * gram[i * this.size + j];
    }
    always.forEach((k, i) => {
      if (this.beyond[i]) cost += steepness * (Math.abs(c[k]) - deviations) ** 2;
    });
    return {c, cost};
  }

  /* Rows of the Cholesky factor are kept as far as the set before began with the same columns. */
  factor(free) {
    const {L, size, factored, held, beyond} = this;
    const {gram, steepness} = this.data;
    let first = 0;
    while (first < free.length && free[first] === factored[first]
           && (beyond[first] ?? 0) === (held[first] ?? 0)) first++;
    for (let i = first; i < free.length; i++) {
      for (let j = 0; j <= i; j++) {
        let sum = gram[free[i] * size + free[j]];
        if (i === j) sum = sum * (1 + 1e-12) + steepness * Math.abs(beyond[i] ?? 0);
        for (let k = 0; k < j; k++) sum -= L[i * size + k] * L[j * size + k];
        L[i * size + j] = i === j ? Math.sqrt(sum) : sum / L[j * size + j];
      }
    }
    this.factored = free;
    this.held = [...beyond];
  }

  /* Fill in the free coefficients, and return ln det of the system. */
  solve(free, fixed, c) {
    const {L, size, beyond} = this;
    const {gram, side, deviations, steepness} = this.data;
    const n = free.length, z = new Float64Array(n);
    let logDet = 0;
    for (let i = 0; i < n; i++) {
      let b = side[free[i]] + steepness * deviations * (beyond[i] ?? 0);
      for (const k of fixed) b -= gram[free[i] * size + k];
      for (let j = 0; j < i; j++) b -= L[i * size + j] * z[j];
      z[i] = b / L[i * size + i];
      logDet += 2 * Math.log(L[i * size + i]);
    }
    for (let i = n - 1; i >= 0; i--) {
      let sum = z[i];
      for (let k = i + 1; k < n; k++) sum -= L[k * size + i] * c[free[k]];
      c[free[i]] = sum / L[i * size + i];
    }
    return logDet;
  }

  price(placements, c) {
    const {effects, name_price, wrong_sign_price, drive_prices} = this.data;
    let price = 0;
    for (const one of placements) {
      price += one.price;
      if (one.signs.some(([k, bound]) => c[k] < bound)) price += wrong_sign_price;
    }
    for (const effect of effects) {
      const used = effect.placements.filter((one) => placements.includes(one));
      price += name_price * new Set(used.flatMap((one) => one.hypotheses)).size;
      if (used.length && used[0].drive) price += drive_prices[used.length - 1];
    }
    return price;
  }
}

/* Weights of a drive's columns, of the error and of the error as given. */
export const weightsOf = ({columns}, c) => [...Array.from(columns, (k) => -c[k]), 1, 0];

/* Root of the mean square that coefficients leave on a drive. */
export const errorOf = (drive, c) => {
  const n = drive.columns.length + 1, weights = weightsOf(drive, c);
  let sum = 0;
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) sum += weights[i] * weights[j] * drive.products[i * n + j];
  }
  return Math.sqrt(Math.max(sum, 0) / drive.samples);
};

/* A weighted sum of rows of a drive over time; NaN where nothing was measured. */
export const curveOf = ({rows, scales, points}, weights, gap) => {
  const sum = new Float64Array(points);
  weights.forEach((weight, r) => {
    const factor = weight * scales[r], first = r * points;
    if (factor) for (let t = 0; t < points; t++) sum[t] += factor * rows[first + t];
  });
  const first = points * weights.lastIndexOf(1);
  return sum.map((value, t) => (rows[first + t] === gap ? NaN : value));
};
