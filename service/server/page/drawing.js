// The path of a program in three dimensions: turned, moved and enlarged by pointer, wheel and keys.

import { element, setAttribute, setText } from "./dom.js";
import { CUT, KINDS, Path, RAPID, STRIDE, VIBRATING } from "./path.js";
import { number, t } from "./text.js";

const MARGIN_PX = 48;
const PICK_PX = 8;
/** Pieces that are drawn while the picture moves; all of them when it rests. */
const WHILE_MOVING = 40_000;
const REST_MS = 120;
const TURN_PER_PX = 0.008;
const TURN_PER_KEY = Math.PI / 24;
const MOVE_PER_KEY_PX = 40;
const ZOOM_PER_KEY = 1.25;
const [LEAST_ZOOM, MOST_ZOOM] = [0.02, 5000];
const AXIS_PX = 46;

/** Directions from which the path is looked at: turn about Z, and height, radians. */
const VIEWS = {
  viewSpace: { turn: Math.PI / 6, height: 0.55 },
  viewTop: { turn: 0, height: Math.PI / 2 },
  viewFront: { turn: 0, height: 0 },
  viewSide: { turn: Math.PI / 2, height: 0 },
};
/** A lathe is looked at as its drawings are: Z to the right, X up. */
const LATHE_VIEW = { isLathe: true };

/** The three rows of a projection: to the right, upwards, towards the eye. */
const rowsOf = ({ turn, height, isLathe }) => {
  if (isLathe) return [[0, 0, 1], [1, 0, 0], [0, 1, 0]];
  const [s, c] = [Math.sin(turn), Math.cos(turn)];
  const [sh, ch] = [Math.sin(height), Math.cos(height)];
  return [[c, s, 0], [-s * sh, c * sh, ch], [s * ch, -c * ch, sh]];
};

const dot = (row, x, y, z) => row[0] * x + row[1] * y + row[2] * z;

/** A round length for a bar of at most so many millimetres. */
const roundLength = (most) => {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((factor) => factor * power).find((length) => length <= most) ?? power;
};

/**
 * A drawing in a box of its own. `onPoint` is told the line that the pointer is on (0: none), `onChoose` the one that was
 * clicked.
 */
export const drawing = ({ onPoint, onChoose }) => {
  let path = new Path();
  let view = VIEWS.viewSpace;
  let isLathe = false;
  let zoom = 1;
  let shift = [0, 0];
  let line = 0;
  let hidden = true;
  let [width, height, ratio] = [0, 0, 1];
  let isMoving = false;
  let resting = 0;
  let frame = 0;
  /** Where the ends of the pieces are on the canvas, px. */
  let screen = new Float32Array(0);
  /** A finger or button that is down, by its id. */
  const down = new Map();
  let moved = 0;

  const canvas = element("canvas", { class: "path-canvas", tabindex: "0", role: "img" });
  const said = element("p", { class: "path-said" });
  const legend = element("ul", { class: "legend" });
  const views = element("div", { class: "path-views", role: "group" });
  const hint = element("p", { class: "keys" });
  const box = element("div", { class: "path-box" }, canvas);
  const root = element("section", { class: "path" }, views, box, legend, said, hint);

  const middle = () => [0, 1, 2].map((axis) => (path.least[axis] + path.most[axis]) / 2);

  /** Pixels of a millimetre when the whole path is seen. */
  const fitted = (rows) => {
    const half = [0, 1, 2].map((axis) => (path.most[axis] - path.least[axis]) / 2);
    const reach = rows.slice(0, 2).map((row) => 2 * row.reduce((sum, part, axis) => sum + Math.abs(part) * half[axis], 0));
    const across = Math.max(1, width - 2 * MARGIN_PX) / Math.max(reach[0], 1e-3);
    const up = Math.max(1, height - 2 * MARGIN_PX) / Math.max(reach[1], 1e-3);
    return Math.min(across, up, 1e5);
  };

  const color = (style, name) => style.getPropertyValue(name).trim();

  const stroke = (context, wanted, step) => {
    context.beginPath();
    let [lastX, lastY] = [NaN, NaN];
    for (let piece = 0; piece < path.count; piece += step) {
      if (!wanted(piece)) continue;
      const at = piece * 4;
      const [x0, y0, x1, y1] = [screen[at], screen[at + 1], screen[at + 2], screen[at + 3]];
      if (x0 !== lastX || y0 !== lastY) context.moveTo(x0, y0);
      context.lineTo(x1, y1);
      [lastX, lastY] = [x1, y1];
    }
    context.stroke();
  };

  const drawAxes = (context, style, rows) => {
    // In the corner, so that they are seen wherever the path is.
    const [x, y] = [MARGIN_PX + 8, height - MARGIN_PX - 8];
    context.lineWidth = 2;
    context.font = "600 13px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.strokeStyle = context.fillStyle = color(style, "--quiet");
    ["X", "Y", "Z"].forEach((name, axis) => {
      const [dx, dy] = [rows[0][axis] * AXIS_PX, -rows[1][axis] * AXIS_PX];
      if (Math.hypot(dx, dy) < 6) return;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + dx * 0.72, y + dy * 0.72);
      context.stroke();
      context.fillText(name, x + dx * 0.95, y + dy * 0.95);
    });
  };

  const drawScale = (context, style, scale) => {
    const length = roundLength(Math.max(1e-6, (width * 0.28) / scale));
    const px = length * scale;
    const [x, y] = [width - 16 - px, height - 18];
    context.strokeStyle = context.fillStyle = color(style, "--quiet");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x, y - 5);
    context.lineTo(x, y);
    context.lineTo(x + px, y);
    context.lineTo(x + px, y - 5);
    context.stroke();
    context.font = "13px system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "bottom";
    context.fillText(`${number(length, length < 1 ? Math.ceil(-Math.log10(length)) : 0)} mm`, x + px, y - 7);
  };

  const drawZero = (context, style, project) => {
    const [x, y] = project(0, 0, 0);
    context.strokeStyle = color(style, "--quiet");
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.moveTo(x - 9, y);
    context.lineTo(x + 9, y);
    context.moveTo(x, y - 9);
    context.lineTo(x, y + 9);
    context.stroke();
  };

  const paint = () => {
    frame = 0;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (path.count === 0 || width === 0) return;
    const style = getComputedStyle(canvas);
    const rows = rowsOf(view);
    const scale = fitted(rows) * zoom;
    const [mx, my, mz] = middle();
    const [ox, oy] = [width / 2 + shift[0], height / 2 + shift[1]];
    const [right, up] = rows;
    const project = (x, y, z) => [ox + scale * dot(right, x - mx, y - my, z - mz), oy - scale * dot(up, x - mx, y - my, z - mz)];
    if (screen.length < path.count * 4) screen = new Float32Array(path.lines.length * 4);
    const step = isMoving ? Math.max(1, Math.ceil(path.count / WHILE_MOVING)) : 1;
    const { places } = path;
    for (let piece = 0; piece < path.count; piece += step) {
      for (let end = 0; end < 2; end += 1) {
        const from = piece * STRIDE + end * 3;
        const [x, y, z] = [places[from] - mx, places[from + 1] - my, places[from + 2] - mz];
        screen[piece * 4 + end * 2] = ox + scale * dot(right, x, y, z);
        screen[piece * 4 + end * 2 + 1] = oy - scale * dot(up, x, y, z);
      }
    }
    context.lineJoin = context.lineCap = "round";
    drawZero(context, style, project);
    const of = (kind) => (piece) => path.kinds[piece] === kind;
    context.setLineDash([5, 5]);
    context.lineWidth = 1;
    context.strokeStyle = color(style, "--rapid");
    stroke(context, of(RAPID), step);
    context.setLineDash([]);
    context.lineWidth = 1.6;
    context.strokeStyle = color(style, "--trace");
    stroke(context, of(CUT), step);
    context.lineWidth = 2.6;
    context.strokeStyle = color(style, "--vibrating");
    stroke(context, of(VIBRATING), step);
    if (line > 0) {
      context.lineWidth = 8;
      context.strokeStyle = color(style, "--ground");
      stroke(context, (piece) => path.lines[piece] === line, 1);
      context.lineWidth = 5;
      context.strokeStyle = color(style, "--marked");
      stroke(context, (piece) => path.lines[piece] === line, 1);
    }
    drawAxes(context, style, rows);
    drawScale(context, style, scale);
  };
  const repaint = () => {
    frame ||= requestAnimationFrame(paint);
  };
  const moving = () => {
    isMoving = path.count > WHILE_MOVING;
    clearTimeout(resting);
    resting = setTimeout(() => {
      isMoving = false;
      repaint();
    }, REST_MS);
    repaint();
  };

  const turn = (dx, dy) => {
    const from = view.isLathe ? VIEWS.viewTop : view;
    view = { turn: from.turn - dx, height: Math.min(Math.PI / 2, Math.max(-Math.PI / 2, from.height + dy)) };
    drawViews();
    moving();
  };
  const move = (dx, dy) => {
    shift = [shift[0] + dx, shift[1] + dy];
    moving();
  };
  /** Enlarges about a point of the canvas. */
  const enlarge = (factor, x = width / 2, y = height / 2) => {
    const wanted = Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, zoom * factor));
    const [dx, dy] = [x - width / 2 - shift[0], y - height / 2 - shift[1]];
    shift = [shift[0] + dx * (1 - wanted / zoom), shift[1] + dy * (1 - wanted / zoom)];
    zoom = wanted;
    moving();
  };
  const look = (from) => {
    view = from;
    zoom = 1;
    shift = [0, 0];
    drawViews();
    repaint();
  };

  const choices = () => (isLathe ? { viewLathe: LATHE_VIEW, viewSpace: VIEWS.viewSpace } : VIEWS);
  const drawViews = () => {
    setAttribute(views, "aria-label", t("view"));
    const wanted = Object.entries(choices());
    if (views.children.length !== wanted.length || views.dataset.lathe !== String(isLathe)) {
      views.dataset.lathe = String(isLathe);
      views.replaceChildren(...wanted.map(([, from]) => element("button", { type: "button", onclick: () => look(from) })));
    }
    wanted.forEach(([name, from], index) => {
      setText(views.children[index], t(name));
      setAttribute(views.children[index], "aria-pressed", view === from ? "true" : "false");
    });
  };

  /** The line of the piece that is nearest to a point of the canvas; 0 where none is near. */
  const lineNear = (x, y) => {
    let [nearest, best] = [0, PICK_PX ** 2];
    for (let piece = 0; piece < path.count; piece += 1) {
      const at = piece * 4;
      const [x0, y0] = [screen[at], screen[at + 1]];
      const [dx, dy] = [screen[at + 2] - x0, screen[at + 3] - y0];
      const square = dx * dx + dy * dy;
      const share = square > 0 ? Math.min(1, Math.max(0, ((x - x0) * dx + (y - y0) * dy) / square)) : 0;
      const distance = (x0 + share * dx - x) ** 2 + (y0 + share * dy - y) ** 2;
      if (distance < best) [nearest, best] = [path.lines[piece], distance];
    }
    return nearest;
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, [event.offsetX, event.offsetY]);
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = down.get(event.pointerId);
    const now = [event.offsetX, event.offsetY];
    if (!before) {
      onPoint(lineNear(...now));
      return;
    }
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    moved += Math.abs(dx) + Math.abs(dy);
    if (down.size === 2) {
      const other = [...down].find(([id]) => id !== event.pointerId)[1];
      const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]);
      move(dx / 2, dy / 2);
      enlarge(Math.max(1, apart(now)) / Math.max(1, apart(before)), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    } else if (event.shiftKey || event.buttons & 6) move(dx, dy);
    else turn(dx * TURN_PER_PX, dy * TURN_PER_PX);
    down.set(event.pointerId, now);
  });
  const up = (event) => {
    if (down.delete(event.pointerId) && moved < 4 && event.type === "pointerup") {
      const chosen = lineNear(event.offsetX, event.offsetY);
      if (chosen > 0) onChoose(chosen);
    }
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", () => onPoint(0));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    enlarge(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const from = Object.values(choices())[Number(event.key) - 1];
    if (arrow && event.shiftKey) move(-arrow[0] * MOVE_PER_KEY_PX, -arrow[1] * MOVE_PER_KEY_PX);
    else if (arrow) turn(arrow[0] * TURN_PER_KEY, arrow[1] * TURN_PER_KEY);
    else if (event.key === "+" || event.key === "=") enlarge(ZOOM_PER_KEY);
    else if (event.key === "-") enlarge(1 / ZOOM_PER_KEY);
    else if (event.key === "0") look(view);
    else if (from) look(from);
    else return;
    event.preventDefault();
  });

  const resized = new ResizeObserver(() => {
    ratio = devicePixelRatio || 1;
    [width, height] = [box.clientWidth, box.clientHeight];
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    paint();
  });
  resized.observe(box);
  // Colours are the page's, and change with it.
  const themed = new MutationObserver(repaint);
  themed.observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
  const preferred = matchMedia("(prefers-color-scheme: dark)");
  preferred.addEventListener("change", repaint);

  const draw = (state = "") => {
    drawViews();
    setAttribute(root, "data-empty", path.count === 0);
    const shown = [RAPID, CUT, VIBRATING].filter((kind) => path.moves[kind] > 0);
    legend.replaceChildren(...shown.map((kind) =>
      element("li", { "data-kind": KINDS[kind] }, element("span", { class: "legend-line", "aria-hidden": "true" }), `${t(KINDS[kind])}: ${number(path.moves[kind])}`)));
    const range = (axis) => `${"XYZ"[axis]} ${number(path.least[axis], 3)} … ${number(path.most[axis], 3)}`;
    const extent = path.count > 0 ? `${[0, 1, 2].map(range).join(" · ")} mm` : "";
    const radius = isLathe && path.count > 0 ? t("radius") : "";
    setText(said, [state, extent, radius, path.isCut ? t("pathLong", { moves: number(path.moves.reduce((sum, one) => sum + one, 0)) }) : ""].filter(Boolean).join(" · "));
    setAttribute(canvas, "aria-label", `${t("drawing")}: ${path.count > 0 ? [...legend.children].map((one) => one.textContent).concat(extent).join(", ") : state || t("empty")}`);
    setText(hint, t("drawingKeys"));
    repaint();
  };

  return {
    root,
    draw,
    /** Shows another path; the view stays, but for the first one and for another kind of machine. */
    show: (shown, ofLathe, state) => {
      path = shown;
      if (hidden || ofLathe !== isLathe) {
        hidden = path.count === 0;
        isLathe = ofLathe;
        look(isLathe ? LATHE_VIEW : VIEWS.viewSpace);
      }
      draw(state);
    },
    /** Marks what a line does. */
    mark: (marked) => {
      if (marked === line) return;
      line = marked;
      setAttribute(canvas, "data-line", line);
      repaint();
    },
    end: () => {
      resized.disconnect();
      themed.disconnect();
      preferred.removeEventListener("change", repaint);
      clearTimeout(resting);
      cancelAnimationFrame(frame);
    },
  };
};
