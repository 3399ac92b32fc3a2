// Trends over one time axis: a line of steps or of points, a band of limits, marks of decisions.

import { element, setAttribute, setText } from "./dom.js";
import { clock, number, t } from "./text.js";

/** Where nothing is laid out yet. */
const USUAL_WIDTH = 1000;
const HEIGHT = 150;
const LEFT = 70;
const RIGHT = 12;
const TOP = 10;
const BOTTOM = 22;
const MOST_POINTS = 100;
/** A smaller range than this share of its values is noise. */
const LEAST_RANGE = 0.02;

/** Round numbers for about so many ticks. */
export const ticks = (from, to, count) => {
  const raw = (to - from) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  const list = [];
  for (let value = Math.ceil(from / step) * step; value <= to + step * 1e-9; value += step) list.push(value);
  return list;
};

/** Digits behind the point that tell such ticks apart, in a unit that is so many times smaller. */
export const digitsOf = (marks, factor = 1) => {
  const apart = (marks[1] - marks[0]) * factor;
  return apart > 0 ? Math.max(0, Math.min(6, -Math.floor(Math.log10(apart) + 1e-9))) : 0;
};

/**
 * A chart with a heading. `draw` is given `{ from, to, points, lower, upper, digits, unit, factor, isStep, now }`: times in
 * ms, points as `[time, value, isWeak]`, `now` where the axis goes on beyond it, `until` where a line of steps ends before.
 */
export const chart = () => {
  const heading = element("h3", { class: "chart-name" });
  const last = element("span", { class: "chart-last" });
  const svg = element("svg", { class: "chart", viewBox: `0 0 ${USUAL_WIDTH} ${HEIGHT}`, role: "img" });
  const root = element("figure", { class: "trend" }, element("figcaption", {}, heading, last), svg);
  const draw = (name, { from, to, points, lower, upper, digits, unit, factor = 1, isStep = false, now, until }) => {
    const width = svg.clientWidth || USUAL_WIDTH;
    setAttribute(svg, "viewBox", `0 0 ${width} ${HEIGHT}`);
    setText(heading, unit ? `${name} (${unit})` : name);
    const known = points.filter(([, value]) => Number.isFinite(value));
    setText(last, known.length > 0 && until !== undefined ? "–" : known.length > 0 ? number(known.at(-1)[1] * factor, digits) : t("empty"));
    const values = [...known.map(([, value]) => value), lower, upper].filter((value) => Number.isFinite(value));
    let [least, most] = [Math.min(...values), Math.max(...values)];
    if (values.length === 0) [least, most] = [0, 1];
    const narrow = Math.max(0, Math.max(Math.abs(least), Math.abs(most)) * LEAST_RANGE - (most - least)) / 2;
    const margin = narrow + ((most - least) * 0.12 || Math.abs(most) * 0.1 || 1);
    [least, most] = [least - margin, most + margin];
    const marks = ticks(least, most, 4);
    const tickDigits = Math.max(digits, digitsOf(marks, factor));
    const x = (time) => LEFT + ((time - from) / Math.max(1, to - from)) * (width - LEFT - RIGHT);
    const y = (value) => TOP + ((most - value) / (most - least)) * (HEIGHT - TOP - BOTTOM);
    const parts = [];
    if (Number.isFinite(lower) && Number.isFinite(upper)) {
      parts.push(element("rect", { class: "chart-band", x: LEFT, width: width - LEFT - RIGHT, y: y(upper), height: Math.max(1, y(lower) - y(upper)) }));
    }
    for (const tick of marks) {
      parts.push(element("line", { class: "chart-grid", x1: LEFT, x2: width - RIGHT, y1: y(tick), y2: y(tick) }));
      parts.push(element("text", { class: "chart-tick", x: LEFT - 6, y: y(tick) + 4, "text-anchor": "end" }, number(tick * factor, tickDigits)));
    }
    let d = "";
    let before = null;
    for (const [time, value] of known) {
      if (before === null) d += `M${x(time).toFixed(1)} ${y(value).toFixed(1)}`;
      else if (isStep) d += `H${x(time).toFixed(1)}V${y(value).toFixed(1)}`;
      else d += `L${x(time).toFixed(1)} ${y(value).toFixed(1)}`;
      before = value;
    }
    // What is to come is not known.
    const end = now ?? to;
    if (isStep && before !== null) d += `H${x(Math.max(known.at(-1)[0], Math.min(end, until ?? end))).toFixed(1)}`;
    parts.push(element("path", { class: "chart-line", d }));
    // A point for each of very many values would hide them.
    for (const [time, value, isWeak] of isStep || known.length > MOST_POINTS ? [] : known) {
      parts.push(element("circle", { class: isWeak ? "chart-point weak" : "chart-point", cx: x(time), cy: y(value), r: 3 }));
    }
    if (now !== undefined) parts.push(element("line", { class: "chart-now", x1: x(now), x2: x(now), y1: TOP, y2: HEIGHT - BOTTOM }));
    for (const time of [from, (from + end) / 2, end]) {
      const anchor = time === from ? "start" : time === end ? "end" : "middle";
      const said = time === now ? `${t("now")} ${clock(time)}` : clock(time);
      parts.push(element("text", { class: "chart-tick", x: x(time), y: HEIGHT - 6, "text-anchor": anchor }, said));
    }
    svg.replaceChildren(...parts);
    const said = known.length === 0
      ? `${name}: ${t("empty")}`
      : t("chart", {
        name,
        from: number(Math.min(...known.map(([, value]) => value)) * factor, digits),
        to: number(Math.max(...known.map(([, value]) => value)) * factor, digits),
        last: number(known.at(-1)[1] * factor, digits),
        unit,
      });
    setAttribute(svg, "aria-label", said);
  };
  return { root, draw };
};

/** Where a time is on the axis of the charts, as a length of CSS in a box as wide as they are. */
export const timePlace = (time, from, to) => {
  const share = (time - from) / Math.max(1, to - from);
  return `calc(${LEFT}px + (100% - ${LEFT + RIGHT}px) * ${share.toFixed(5)})`;
};
