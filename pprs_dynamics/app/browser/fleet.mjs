/* Trends of a fleet: a click on the map shows one, a click on a trend its recording. */

import {$, make, whenDark} from './dom.mjs';

const MILLISECONDS = 864e5; // of a day
const PATIENCE = 100; // [ms] between looks whether the map is drawn
const SEPARATOR = '\0'; // of a robot and a quantity

const stamp = (day) => new Date(day * MILLISECONDS).toISOString();

/* What Plotly draws of a trend, and how. */
export const traceOf = (trend, quantity, {beside, recordings, colours}) => {
  const x = trend.t.map(stamp);
  const data = [
    {x, y: trend.y, mode: 'markers', name: quantity, customdata: trend.r,
     marker: {color: colours[0]},
     hovertemplate: `%{x}<br>%{y:.4g} ${trend.unit}<extra>click: the recording</extra>`,
     error_y: {type: 'data', array: trend.s, thickness: 1, width: 2}},
    {x, y: trend.f, mode: 'lines', name: trend.text ? 'change' : 'median',
     line: {color: colours[1]}}];
  const layout = {
    height: 420, margin: {l: 70, r: beside ? 70 : 15, t: 20, b: 50},
    yaxis: {title: {text: quantity + (trend.unit ? ` [${trend.unit}]` : '')}},
    legend: {orientation: 'h', y: 1.02, yanchor: 'bottom'}};
  if (trend.limit !== null) {
    data.push({x: [x[0], x.at(-1)], y: [trend.limit, trend.limit], mode: 'lines', name: 'limit',
               line: {dash: 'dash', color: colours[2]}});
  }
  if (beside) {
    data.push({x, y: trend.r.map((k) => recordings[k][3]), mode: 'lines+markers', name: beside,
               yaxis: 'y2', opacity: 0.5, line: {color: colours[2]}});
    layout.yaxis2 = {overlaying: 'y', side: 'right', title: {text: beside}, tickmode: 'auto',
                     showgrid: false};
  }
  return {data, layout};
};

/* The command of a recording's own page, for a shell; `given` are options, quoted already. */
export const commandOf = (path, given) => `pprs diagnose '${path.replaceAll("'", "'\\''")}'${
  given} --report recording.html`;

export const prepare = () => {
  const fleet = JSON.parse($('fleet-data').textContent);
  const place = $('trend'), card = $('recording');
  let shown = fleet.first;

  const showRecording = (k) => {
    const [name, path, day] = fleet.recordings[k];
    const line = make('p', 'Its own page: '), table = make('table');
    line.append(make('code', commandOf(path, fleet.given)));
    for (const [key, trend] of Object.entries(fleet.trends)) {
      const at = trend.r.indexOf(k);
      if (at < 0) continue;
      const row = table.insertRow();
      for (const text of [key.split(SEPARATOR)[1], trend.y[at].toPrecision(4), trend.unit]) {
        row.insertCell().textContent = text;
      }
    }
    card.replaceChildren(make('h3', `${name}, ${stamp(day).slice(0, 19)} UTC`), line, table);
    card.hidden = false;
  };

  const showTrend = (robot, quantity) => {
    shown = [robot, quantity];
    const trend = fleet.trends[robot + SEPARATOR + quantity];
    card.hidden = true;
    $('trend-title').textContent = `${robot}, ${quantity}${
      !trend ? ': not drawn, too many recordings for one page'
        : trend.text ? ` ${trend.text}` : ': no change'}`;
    if (!trend) return;
    place.setAttribute('aria-label', `${quantity} of ${robot} over time`);
    const drawn = window.themed(JSON.stringify(traceOf(trend, quantity, fleet)));
    Plotly.react(place, drawn.data, drawn.layout, {displayModeBar: false, responsive: true});
    place.removeAllListeners('plotly_click');
    place.on('plotly_click', ({points: [{customdata}]}) => {
      if (customdata !== undefined) showRecording(customdata);
    });
  };

  // The page unpacks its library, and draws a figure once it is in view.
  const begin = () => {
    const map = document.querySelector('.plot');
    if (!window.Plotly || !map.on) {
      setTimeout(begin, PATIENCE);
      return;
    }
    map.on('plotly_click', ({points: [{x, y}]}) => showTrend(y, x));
    if (shown) showTrend(...shown);
  };
  begin();
  whenDark(() => { if (shown) showTrend(...shown); });
};
