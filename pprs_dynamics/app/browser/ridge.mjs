/* What-if fits of a diagnosis: a small ridge system, solved for the effects that are ticked. */

const MOST_ROUNDS = 12; // until the numbers at their limits are known

const dot = (a, b) => a.reduce((sum, one, i) => sum + one * b[i], 0);

/* ln of the distribution function of the standard normal: a series, and far below the continued
   fraction of Mills' ratio (G. Marsaglia, J. Stat. Softw. 11 (2004) 4). */
const logNormal = (x) => {
  const density = -x * x / 2 - Math.log(2 * Math.PI) / 2;
  if (x > 8) return 0;
  if (x < -3) {
    let fraction = -x;
    for (let k = 200; k > 0; k--) fraction = -x + k / fraction;
    return density - Math.log(fraction);
  }
  let sum = x, term = x, before = 0;
  for (let k = 3; sum !== before; k += 2) {
    before = sum;
    term *= x * x / k;
    sum += term;
  }
  return Math.log(0.5 + sum * Math.exp(density));
};

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
    let cost = logDet + this.bothSides(c) + this.priorCost(placements, c);
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

  /* What -2 ln of the integral over numbers with a tolerance has more: see `Prior`. */
  bothSides(c) {
    const {always, deviations, steepness} = this.data;
    let more = 0;
    always.forEach((k, i) => {
      if (!this.limited.has(k)) return;
      const column = this.whitened(i), variance = dot(column, column);
      const isBeyond = this.held[i] ? 1 : 0;
      const precise = 1 / variance - steepness * isBeyond, steep = precise + steepness;
      const pulled = Math.abs(c[k]) / variance - steepness * deviations * isBeyond;
      const within = pulled / precise, outside = (pulled + steepness * deviations) / steep;
      const above = steepness * precise / steep * (within - deviations) ** 2
        + Math.log(steep / precise);
      const inner = logNormal((deviations - within) * Math.sqrt(precise));
      const outer = logNormal((outside - deviations) * Math.sqrt(steep)) - above / 2;
      const most = Math.max(inner, outer);
      more -= 2 * (most + Math.log(Math.exp(inner - most) + Math.exp(outer - most)))
        + isBeyond * above;
    });
    return more;
  }

  /* A column of the inverse of the factor: its square is the variance. */
  whitened(at) {
    const {L, size, factored} = this;
    const z = new Float64Array(factored.length);
    for (let i = at; i < factored.length; i++) {
      let sum = i === at ? 1 : 0;
      for (let j = at; j < i; j++) sum -= L[i * size + j] * z[j];
      z[i] = sum / L[i * size + i];
    }
    return z;
  }

  priorCost(placements, c) {
    const {effects, name_prior_cost, wrong_sign_odds, drive_prior_costs} = this.data;
    let priorCost = 0;
    for (const one of placements) {
      priorCost += one.prior_cost;
      for (const [k, bound] of one.signs) { // as `PriorCosts.of_sign`
        const column = this.whitened(this.factored.indexOf(k));
        const z = (c[k] - bound) / Math.sqrt(dot(column, column));
        const right = Math.log(1 - wrong_sign_odds) + logNormal(z);
        const wrong = Math.log(wrong_sign_odds) + logNormal(-z);
        const most = Math.max(right, wrong);
        priorCost -= 2 * (Math.log(2) + most
          + Math.log(Math.exp(right - most) + Math.exp(wrong - most)));
      }
    }
    for (const effect of effects) {
      const used = effect.placements.filter((one) => placements.includes(one));
      priorCost += name_prior_cost * new Set(used.flatMap((one) => one.hypotheses)).size;
      if (used.length && used[0].drive) priorCost += drive_prior_costs[used.length - 1];
    }
    return priorCost;
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
