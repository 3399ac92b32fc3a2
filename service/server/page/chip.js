// The chip of vibrating sections: how thick it is around the revolution, and the tracks of the tool that make it so
// (docs/functions/path-vibration.md, "Will the chip break?").

import { digitsOf, ticks } from "./chart.js";
import { element, setText } from "./dom.js";
import { number, t } from "./text.js";

/** Different cuts that are drawn; sections of one program are mostly alike. */
const MOST_CUTS = 8;
const REVOLUTIONS = 4;
const POINTS_PER_REVOLUTION = 360;
/** Earlier revolutions that are looked at: further ones are hidden behind these, or nearly so. */
const MOST_EARLIER = 200;
/** At half-integer D half the feed is enough; a little more breaks the chip with certainty. */
const SUGGESTED_AMPLITUDE = 0.6;
const TURN = 2 * Math.PI;
const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [640, 200, 64, 12, 10, 34];

/** Uncut thickness at a place in revolutions, mm: 0 or less where the tool cuts air. */
export const thickness = ({ feed, amplitude, vibrations }, revolutions, earlier = MOST_EARLIER) => {
  const phase = TURN * vibrations * revolutions;
  let least = Infinity;
  for (let back = 1; back <= earlier; back += 1) {
    const lag = Math.PI * back * vibrations;
    const left = back * feed + 2 * amplitude * Math.sin(lag) * Math.cos(phase - lag);
    if (left < least) least = left;
    // What is further back is thicker than all that is left.
    if ((back + 1) * feed - 2 * amplitude > least) break;
  }
  return least;
};

/** 2A·|sin πD| over the feed per revolution: the chip breaks at 1 and above. */
const marginOf = ({ feed, amplitude, vibrations }) => (2 * amplitude * Math.abs(Math.sin(Math.PI * vibrations))) / feed;

/** The programmed cut of a section and, where it does not break the chip, the suggested one. */
export const cutsOf = (section) => {
  const chip = section.chip;
  if (!chip || !(chip.feedMmPerRev > 0)) return [];
  const programmed = {
    name: "chipProgrammed", feed: chip.feedMmPerRev, amplitude: section.amplitudeMm, frequency: section.frequencyHz,
    vibrations: chip.vibrationsPerRev, spindle: chip.spindleRevPerMin, isBroken: chip.broken,
  };
  const frequency = chip.recommendedFrequenciesHz?.[0];
  if (chip.broken || frequency === undefined) return [programmed];
  const suggested = { ...programmed, name: "chipSuggested", frequency, vibrations: (60 * frequency) / chip.spindleRevPerMin };
  if (marginOf(suggested) < 1) suggested.amplitude = SUGGESTED_AMPLITUDE * suggested.feed;
  return [programmed, { ...suggested, isBroken: marginOf(suggested) >= 1 }];
};

const verdictOf = (cut) => {
  const margin = marginOf(cut);
  const perRev = t("chipPerRev", { count: number(cut.vibrations, 3) });
  if (cut.isBroken) return `${perRev}: ${t("chipBreaks")}`;
  // In phase: what is left of the sine is rounding.
  if (margin < 1e-9) return `${perRev}: ${t("chipInPhase")}`;
  return `${perRev}: ${t("chipShort", { percent: number(margin * 100, margin < 0.1 ? 1 : 0) })}`;
};

/** A diagram with axes; `curves` is given the places of values and makes what is drawn. */
const diagram = ({ label, range, across, unit, xTicks, xTitle }, curves) => {
  const [least, most] = range;
  const x = (value) => LEFT + (value / across) * (WIDTH - LEFT - RIGHT);
  const y = (value) => TOP + ((most - value) / (most - least)) * (HEIGHT - TOP - BOTTOM);
  const list = ticks(least, most, 4);
  const digits = digitsOf(list);
  const grid = list.flatMap((value) => [
    element("line", { class: "chart-grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value) }),
    element("text", { class: "chart-tick", x: LEFT - 6, y: y(value) + 4, "text-anchor": "end" }, number(value, digits)),
  ]);
  const below = xTicks.map((value) => element("text", { class: "chart-tick", x: x(value), y: HEIGHT - 18, "text-anchor": value === 0 ? "start" : value === across ? "end" : "middle" }, number(value)));
  return element(
    "svg", { class: "chart chip-chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label },
    ...grid, ...below,
    element("text", { class: "chart-tick", x: LEFT, y: HEIGHT - 3 }, xTitle),
    element("text", { class: "chart-tick", x: LEFT - 6, y: HEIGHT - 18, "text-anchor": "end" }, unit),
    ...curves(x, y),
  );
};

const polyline = (points, x, y) => points.map(([at, value], index) => `${index === 0 ? "M" : "L"}${x(at).toFixed(1)} ${y(value).toFixed(1)}`).join("");

const padded = (values, share) => {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const margin = (most - least) * share || 1e-3;
  return [least - margin, most + margin];
};

const curveOf = (cut) => Array.from({ length: REVOLUTIONS * POINTS_PER_REVOLUTION + 1 }, (_, step) => {
  const at = step / POINTS_PER_REVOLUTION;
  return [at, thickness(cut, at)];
});

const thicknessDiagram = (cut, curve, range) => diagram(
  { label: `${t("chipThickness")}: ${verdictOf(cut)}`, range, across: REVOLUTIONS, unit: "mm", xTicks: [0, 1, 2, 3, 4], xTitle: t("chipRevolutions") },
  (x, y) => {
    const area = (side) => `${polyline([[0, 0], ...curve.map(([at, value]) => [at, side(value)]), [REVOLUTIONS, 0]], x, y)}Z`;
    return [
      element("path", { class: "chip-cut", d: area((value) => Math.max(0, value)) }),
      element("path", { class: "chip-air", d: area((value) => Math.min(0, value)) }),
      element("line", { class: "chip-zero", x1: LEFT, x2: WIDTH - RIGHT, y1: y(0), y2: y(0) }),
      element("path", { class: "chart-line", d: polyline(curve, x, y) }),
    ];
  },
);

const tracksDiagram = (cut) => {
  const tracks = Array.from({ length: REVOLUTIONS }, (_, revolution) =>
    Array.from({ length: POINTS_PER_REVOLUTION + 1 }, (__, step) => {
      const at = revolution + step / POINTS_PER_REVOLUTION;
      return [(360 * step) / POINTS_PER_REVOLUTION, cut.feed * at + cut.amplitude * Math.sin(TURN * cut.vibrations * at)];
    }));
  const range = padded(tracks.flat().map(([, value]) => value), 0.08);
  return diagram(
    { label: t("chipTracks"), range, across: 360, unit: "mm", xTicks: [0, 90, 180, 270, 360], xTitle: t("chipAngle") },
    (x, y) => tracks.map((track, revolution) =>
      element("path", { class: "chip-track", "data-newest": revolution === REVOLUTIONS - 1, d: polyline(track, x, y) })),
  );
};

/** The chips of a report: one picture for each cut that is another. */
export const chips = () => {
  const title = element("h2");
  const list = element("div", { class: "chips" });
  const root = element("section", { hidden: true }, title, list);
  const draw = (report) => {
    const drawn = new Set();
    const pictures = [];
    let more = 0;
    for (const section of report?.sections ?? []) {
      const cuts = cutsOf(section);
      const key = cuts.map((cut) => [cut.frequency, cut.amplitude, cut.spindle, cut.feed].join(" ")).join(";");
      if (cuts.length === 0 || drawn.has(key)) continue;
      drawn.add(key);
      if (pictures.length >= MOST_CUTS) {
        more += 1;
        continue;
      }
      const curves = cuts.map(curveOf);
      // One scale for all, so that the cuts can be compared.
      const range = padded([0, ...curves.flat().map(([, value]) => value)], 0.1);
      pictures.push(element(
        "article", { class: "chip", "data-line": section.firstLine },
        element("h3", { class: "chart-name" }, t("chipLines", { first: section.firstLine, last: section.lastLine, spindle: number(cuts[0].spindle), feed: number(cuts[0].feed, 4) })),
        ...cuts.map((cut, index) => element(
          "figure", { class: "trend", "data-broken": cut.isBroken },
          element("figcaption", {}, element("strong", {}, t(cut.name, { frequency: number(cut.frequency, 1), amplitude: number(cut.amplitude, 4) })), element("span", { class: "chip-verdict" }, verdictOf(cut))),
          thicknessDiagram(cut, curves[index], range), tracksDiagram(cut),
        )),
      ));
    }
    root.hidden = pictures.length === 0;
    setText(title, t("chips"));
    list.replaceChildren(...pictures, ...(more > 0 ? [element("p", { class: "notice" }, t("chipMore", { count: more }))] : []));
  };
  return { root, draw };
};
