// The path of a program as straight pieces, from its actions: arcs and splines become curves of many.

/** Kinds of pieces, in the order in which they are drawn. */
export const RAPID = 0;
export const CUT = 1;
export const VIBRATING = 2;
export const KINDS = ["pathRapid", "pathCut", "pathVibrating"];

/** Pieces that are kept at most: a longer path ends there, and says so. */
const MOST_PIECES = 300_000;
/** The largest angle of a piece of an arc, and pieces of one arc at most. */
const ARC_STEP_RAD = Math.PI / 60;
const MOST_ARC_PIECES = 1440;
const SPLINE_PIECES = 8;
const MOST_SPLINE_PIECES = 4000;
/** Numbers of a piece: both ends. */
export const STRIDE = 6;

const MOTIONS = new Set(["LINE", "ARC", "SPLINE", "THREAD", "TAP"]);
/** Machining functions that let a cut vibrate; threads have one of their own. */
const OF_CUTS = ["path_vibration", "tool_oscillation"];
const OF_THREADS = "thread_vibration";

/** First, second and third axis of a plane. */
const PLANES = {
  ACTION_PLANE_XY: ["x", "y", "z"], ACTION_PLANE_ZX: ["z", "x", "y"], ACTION_PLANE_YZ: ["y", "z", "x"],
};

const xyz = (position) => [position?.x ?? 0, position?.y ?? 0, position?.z ?? 0];

const arcPoints = ({ start, end, plane, arc }) => {
  const [first, second, third] = PLANES[plane] ?? PLANES.ACTION_PLANE_XY;
  const sweep = (arc.sweepDeg * Math.PI) / 180;
  const count = Math.max(1, Math.min(MOST_ARC_PIECES, Math.ceil(Math.abs(sweep) / ARC_STEP_RAD)));
  const from = [start[first] - arc.centerFirst, start[second] - arc.centerSecond];
  const to = [end[first] - arc.centerFirst, end[second] - arc.centerSecond];
  const angle = Math.atan2(from[1], from[0]);
  const radii = [Math.hypot(...from), Math.hypot(...to)];
  return Array.from({ length: count + 1 }, (_, step) => {
    const share = step / count;
    // Unequal radii are a spiral.
    const radius = radii[0] + (radii[1] - radii[0]) * share;
    const point = {
      [first]: arc.centerFirst + radius * Math.cos(angle + sweep * share),
      [second]: arc.centerSecond + radius * Math.sin(angle + sweep * share),
      [third]: start[third] + (end[third] - start[third]) * share,
    };
    return xyz(step === count ? end : point);
  });
};

/** A point of a NURBS with uniform knots, clamped at both ends, by de Boor's rule. */
const splinePoint = ({ order, first, second, weights }, at) => {
  const degree = order - 1;
  const spans = first.length - degree;
  const span = Math.min(spans - 1, Math.floor(at));
  const knot = (index) => Math.min(spans, Math.max(0, index - degree));
  const points = Array.from({ length: order }, (_, index) => {
    const weight = weights[span + index] ?? 1;
    return [first[span + index] * weight, second[span + index] * weight, weight];
  });
  for (let level = 1; level <= degree; level += 1) {
    for (let index = degree; index >= level; index -= 1) {
      const low = knot(span + index);
      const high = knot(span + index + order - level);
      const share = high > low ? (at - low) / (high - low) : 0;
      points[index] = points[index].map((value, axis) => points[index - 1][axis] * (1 - share) + value * share);
    }
  }
  const [a, b, weight] = points[degree];
  return [a / weight, b / weight];
};

const splinePoints = ({ start, end, plane, spline }) => {
  const [first, second, third] = PLANES[plane] ?? PLANES.ACTION_PLANE_XY;
  const spans = spline.first.length - spline.order + 1;
  if (spans < 1) return [xyz(start), xyz(end)];
  const count = Math.max(16, Math.min(MOST_SPLINE_PIECES, spans * SPLINE_PIECES));
  return Array.from({ length: count + 1 }, (_, step) => {
    if (step === 0) return xyz(start);
    if (step === count) return xyz(end);
    const [a, b] = splinePoint(spline, (step / count) * spans);
    return xyz({ [first]: a, [second]: b, [third]: start[third] + (end[third] - start[third]) * (step / count) });
  });
};

/** A path that grows with actions. */
export class Path {
  constructor() {
    this.count = 0;
    this.isCut = false;
    this.places = new Float32Array(STRIDE * 1024);
    this.lines = new Uint32Array(1024);
    this.kinds = new Uint8Array(1024);
    this.moves = [0, 0, 0];
    this.least = [Infinity, Infinity, Infinity];
    this.most = [-Infinity, -Infinity, -Infinity];
    this.functions = new Set();
  }

  #kindOf(kind) {
    if (kind === "RAPID") return RAPID;
    const vibrates = kind === "THREAD" ? this.functions.has(OF_THREADS) : OF_CUTS.some((name) => this.functions.has(name));
    return vibrates && kind !== "TAP" ? VIBRATING : CUT;
  }

  #piece(from, to, line, kind) {
    if (this.count >= MOST_PIECES) {
      this.isCut = true;
      return;
    }
    if (this.count === this.lines.length) {
      const grown = (old, factor) => {
        const made = new old.constructor(this.count * 2 * factor);
        made.set(old);
        return made;
      };
      [this.places, this.lines, this.kinds] = [grown(this.places, STRIDE), grown(this.lines, 1), grown(this.kinds, 1)];
    }
    this.places.set([...from, ...to], this.count * STRIDE);
    this.lines[this.count] = line;
    this.kinds[this.count] = kind;
    this.count += 1;
    for (let axis = 0; axis < 3; axis += 1) {
      this.least[axis] = Math.min(this.least[axis], from[axis], to[axis]);
      this.most[axis] = Math.max(this.most[axis], from[axis], to[axis]);
    }
  }

  /** Takes one action; whether there is room for more. */
  add(action) {
    const kind = action.kind.replace("ACTION_KIND_", "");
    if (kind === "FUNCTION") {
      if (action.function?.on) this.functions.add(action.function.name);
      else this.functions.delete(action.function?.name);
    }
    if (kind !== "RAPID" && !MOTIONS.has(kind)) return !this.isCut;
    if (!action.start || !action.end) return !this.isCut;
    const points = kind === "ARC" && action.arc
      ? arcPoints(action)
      : kind === "SPLINE" && action.spline ? splinePoints(action) : [xyz(action.start), xyz(action.end)];
    const drawn = this.#kindOf(kind);
    this.moves[drawn] += 1;
    // A line of another file is none of this text.
    const line = action.file ? 0 : action.line;
    for (let index = 1; index < points.length; index += 1) this.#piece(points[index - 1], points[index], line, drawn);
    return !this.isCut;
  }
}
